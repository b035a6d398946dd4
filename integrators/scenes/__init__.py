"""Scenes: differential equations to be solved, as exact data."""
