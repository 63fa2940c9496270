"""``hbvm-bench endure``: how the energy error of the outer Solar System grows over a million years."""
