"""Linear stability and contractivity of methods, decided exactly."""
