"""A system as a gymnasium environment. Card: README.md."""

from .environment import Environment

__all__ = ["Environment"]
