"""Scenes: problems to be solved, as exact data; one file for each family of built-in ones."""
