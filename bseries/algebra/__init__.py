"""The algebra of B-series: series of methods, composition, logarithm, substitution, modified equations."""
