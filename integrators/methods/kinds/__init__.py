"""Kinds of methods other than Butcher tableaux, one file each."""
