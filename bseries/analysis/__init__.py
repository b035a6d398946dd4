"""Analysis of methods: order, structure, conjugation, and the report of `check`."""
