"""Shadow energies: modified Hamiltonians measured along finished trajectories, from their forces."""
