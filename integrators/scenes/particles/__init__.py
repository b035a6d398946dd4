"""Sums over particles, pairs and other index sets: local form, flat form, polynomial degrees."""
