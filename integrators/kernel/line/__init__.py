"""Line integral methods beyond HBVM: several invariants at once, and Poisson systems."""
