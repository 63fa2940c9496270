"""What can be said of a system and of its states: invariants, structure, formulas."""
