"""Runs paced by the clock: waiting for each step, and the statistics of the times."""
