"""The command line, grasp-cosim."""

from .entry import entry, main

__all__ = ["entry", "main"]
