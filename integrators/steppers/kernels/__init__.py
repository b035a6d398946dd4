"""Compiled kernels that generated steppers call."""
