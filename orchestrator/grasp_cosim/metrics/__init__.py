"""Metrics: functions of recorded signals with a name, a unit and a description.

Signals by role, the registry, metrics from a user's file; which there are is decided higher up.
Imports the ground floor: errors, extensions.
"""
