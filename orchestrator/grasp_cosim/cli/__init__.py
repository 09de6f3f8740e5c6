"""The command line, grasp-cosim.

group.py finds the commands, each a file in commands/; frame.py and options.py is what they share.
"""

from .entry import entry, main

__all__ = ["entry", "main"]
