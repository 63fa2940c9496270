"""From a solution to numbers: metrics, drifts and their laws, checks, ensembles, seconds, and the machine."""
