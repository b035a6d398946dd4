"""Kinds of methods other than Butcher tableaux."""
