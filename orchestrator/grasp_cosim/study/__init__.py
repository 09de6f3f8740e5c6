"""Figures of merit, and comparisons of runs."""
