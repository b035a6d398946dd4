"""Trees as pictures and as networkx graphs."""
