"""Many runs of one system: from a table of values to a table of metrics.

Imports master, metrics, system and what is below them.
"""
