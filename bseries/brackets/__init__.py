"""Nested brackets: free Lie algebras, the Baker–Campbell–Hausdorff series, and what methods are in them."""
