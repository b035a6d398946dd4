"""Order conditions of methods, generated to any order: formulas, equations and code."""
