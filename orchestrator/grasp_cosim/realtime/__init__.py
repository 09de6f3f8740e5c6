"""Runs paced by the clock: pacing, what the operating system grants, and timing statistics."""
