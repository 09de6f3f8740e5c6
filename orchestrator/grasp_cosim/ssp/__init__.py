"""SSP, System Structure and Parameterization: systems to archives of 1.0, archives to systems."""
