"""The value of a traced function, in pairs of doubles or in numbers of 36 digits: one evaluator for all."""
