"""From a solution to numbers: metrics, error growth, checks, ensembles, seconds, and the machine."""
