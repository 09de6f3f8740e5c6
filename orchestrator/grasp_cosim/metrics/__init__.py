"""Metrics: functions of recorded signals with a name, a unit and a description.

Signals by role, groups of metrics by name, metrics from a user's file. What is in a group is
decided higher up, and registered.
"""
