"""The commands inspect and doctor.

The interface of an FMU as a table, and the checks that tell whether this machine will load it.
Imports interface and the ground floor.
"""
