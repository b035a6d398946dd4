"""Modified Hamiltonians: from trees, from brackets and from generating functions."""
