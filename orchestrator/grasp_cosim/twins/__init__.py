"""The native twins of FMUs in Python."""
