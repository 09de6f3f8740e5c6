"""Columns by name: what a run, a log and the signals of a metric have in common."""

from collections.abc import Mapping
from typing import TypeVar

from .errors import choices

V = TypeVar("V")

FEW = 3
"""So many names are in the repr()."""


class ByName(Mapping[str, V]):
    """A mapping of names to arrays, equal to itself only, so that it can be a key and in a set.

    To compare arrays gives arrays: whether two runs are alike says compare().
    """

    __slots__ = ()
    __eq__ = object.__eq__
    __hash__ = object.__hash__

    def __repr__(self) -> str:
        return f"{type(self).__name__} of {len(self)} columns: {choices(self, FEW)}"

    def _ipython_key_completions_(self) -> list[str]:
        """The names, for Tab behind a bracket in a notebook."""
        return [*self]
