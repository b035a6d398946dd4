"""Scenes: initial value problems as exact data."""
