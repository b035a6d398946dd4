"""Nested brackets: free Lie algebras, the Baker–Campbell–Hausdorff series, and methods in terms of them."""
