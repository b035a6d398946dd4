"""Action–angle variables: canonical transformations, Fourier polynomials, and the elimination of angles."""
