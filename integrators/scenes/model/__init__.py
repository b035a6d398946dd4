"""The declaration of a scene: variables, terms, effects, formulas, and the system that they make."""
