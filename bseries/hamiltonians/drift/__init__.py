"""Energy drift: the non-Hamiltonian part of a modified field, and its effect over long times."""
