"""A system as a gymnasium environment. See README.md."""

from .environment import Environment

__all__ = ["Environment"]
