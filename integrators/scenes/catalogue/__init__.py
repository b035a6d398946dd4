"""The built-in scenes, one file for each family."""
