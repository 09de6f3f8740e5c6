"""What the readers of tables share: a table has known keys."""

from collections.abc import Iterable, Mapping
from typing import Any

from .errors import InputError, choices


def as_table(place: str, value: Any) -> dict[str, Any]:
    """The value as a table; InputError where it is none."""
    if not isinstance(value, dict):
        found = "missing" if value is None else repr(value)
        raise InputError(f"{place}: {found}; must be a table")
    return value


def check_keys(place: str, table: Mapping[str, Any], valid: Iterable[str]) -> None:
    """InputError at the first key that is not a valid one."""
    for key in table:
        if key not in valid:
            raise InputError(f"{place}: unknown entry {key!r}; valid: {choices(sorted(valid))}")
