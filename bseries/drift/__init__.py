"""Energy drift: what is not Hamiltonian in a modified field, and what that does over long times."""
