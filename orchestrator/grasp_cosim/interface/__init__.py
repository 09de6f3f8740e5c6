"""What an FMU declares: the one typed reader of a model description, and units."""
