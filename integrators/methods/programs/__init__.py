"""Methods as programs: evaluations of the field and linear combinations of them."""
