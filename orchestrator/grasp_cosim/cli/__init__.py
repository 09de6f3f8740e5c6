"""The command line, grasp-cosim.

group.py says which module has a command; frame.py and options.py are what they share.
"""

from .entry import entry, main

__all__ = ["entry", "main"]
