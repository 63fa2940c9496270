"""The parts of a trajectory's memory, one idea each; `integrators.kernel.context.Context` has them all."""
