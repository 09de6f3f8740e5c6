"""The description of a system, checked once.

Components, connections, events, faults, roles and presets; from and to TOML.
"""
