"""Runs paced by the clock.

Waiting for the next step, what the operating system grants, and the statistics of the times.
"""
