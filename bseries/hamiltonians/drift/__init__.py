"""Energy drift: the part of a modified field that is not Hamiltonian, and its effect over long times."""
