"""Order conditions of many kinds of methods, generated to any order: as formulas, as equations and as code."""
