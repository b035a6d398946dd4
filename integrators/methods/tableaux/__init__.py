"""Butcher tableaux: Runge–Kutta and partitioned Runge–Kutta methods, and their files."""
