"""Compiled kernels called by generated steps."""
