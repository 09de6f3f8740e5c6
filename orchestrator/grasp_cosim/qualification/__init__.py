"""Whether an FMU may take the place of another."""
