"""How far two runs are apart, and whether an FMU may take the place of another."""
