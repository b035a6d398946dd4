"""Advice: what accuracy costs, which effects matter, what a run will take and how wrong it will be."""
