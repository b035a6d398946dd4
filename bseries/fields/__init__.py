"""Series on scenes: modified fields as formulas and as compiled functions."""
