"""System files to start from, and a component of one filled in for a foreign FMU."""
