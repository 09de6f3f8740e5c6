"""What an FMU is: its interface as a table, and whether this machine loads it.

Imports interface and the ground floor.
"""
