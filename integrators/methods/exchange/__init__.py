"""Tableaus in the text and the objects of other packages."""
