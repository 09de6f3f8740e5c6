"""FMU instances behind calls that are bound once."""
