"""What an FMU says about itself, and whether this machine will load it."""
