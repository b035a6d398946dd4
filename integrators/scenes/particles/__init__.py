"""Terms summed over particles, pairs or other index sets: local form, flat form, degrees."""
