"""Runs: many steps, what is observed and stored on the way, and ensembles of runs."""
