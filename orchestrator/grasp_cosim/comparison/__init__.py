"""How far two runs are apart, and whether an FMU may take the place of another.

Imports master, recording and what is below them.
"""
