"""Line integrals beyond HBVM, several invariants and Poisson systems: other values at a step's stages."""
