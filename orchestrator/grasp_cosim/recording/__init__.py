"""Listeners that keep a run while it goes on, and the result, which is plain data."""
