"""Modified Hamiltonians: from trees, from brackets and from generating functions; what they say, and where none are."""
