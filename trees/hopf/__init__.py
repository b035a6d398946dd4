"""Hopf algebras of rooted trees: forests, formal sums, coproducts, antipodes and grafting products."""
