"""The texts of attributes as what they stand for: numbers, names, references and units.

A ValueError, in one line that begins with the place of the attribute, says what is wrong with one.
"""

import math
import re
from collections.abc import Mapping
from fractions import Fraction

from ..base.checks import integer, real
from ..base.si_units import BASE, Unit

CONTROL = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029]")
"""Characters that end a line of a message or table, or move the cursor of a terminal."""
MAX_NAME_LENGTH = 2000
"""Characters; those of the largest FMUs have some hundreds."""


def base_unit(name: str, base: Mapping[str, str]) -> Unit:
    """The unit of the attributes of a BaseUnit of FMI or SSP; ValueError where it is none."""
    place = f"unit {name!r}"
    exponents = tuple(whole_in(f"{place}: {key}", base.get(key, "0")) for key in BASE)
    factor = real_in(f"{place}: factor", base.get("factor", "1"))
    offset = real_in(f"{place}: offset", base.get("offset", "0"))
    if not factor or not math.isfinite(factor) or not math.isfinite(offset):
        raise ValueError(
            f"{place}: factor = {factor:g}, offset = {offset:g}: must be finite, and the factor "
            "other than 0"
        )
    return Unit(name, exponents, factor, offset)


def check_identifier(identifier: str) -> None:
    """ValueError where it could not be the name of a file in a folder of the FMU."""
    if not identifier or CONTROL.search(identifier) or re.search(r"[/\\:]|^\.", identifier):
        raise ValueError(f"modelIdentifier = {identifier!r}: must be the name of its binary")


def printable_name(noun: str, name: str) -> str:
    """The name; ValueError where it is very long or holds a control character."""
    if len(name) > MAX_NAME_LENGTH:
        raise ValueError(
            f"{noun} {name[:40]!r}...: {len(name)} characters; must have at most {MAX_NAME_LENGTH}"
        )
    if CONTROL.search(name):
        raise ValueError(f"{noun} {name!r}: must have no control characters")
    return name


def real_in(place: str, text: str) -> float:
    """The number in a text; `place` begins the message of a ValueError, as in all of these."""
    try:
        return real(text)
    except ValueError:
        raise ValueError(f"{place} = {text!r}: must be a number") from None


def references_in(place: str, clocks: str) -> tuple[int, ...]:
    """The value references of the clocks that a variable is of."""
    return tuple(whole_in(f"{place}: clocks", text) for text in clocks.split())


def decimal_in(place: str, text: str) -> Fraction:
    """The number that a text is, exactly."""
    real_in(place, text)
    try:
        return Fraction(text.strip())
    except ValueError:
        raise ValueError(f"{place} = {text!r}: must be a finite number") from None


def whole_in(place: str, text: str | None, high: int | None = None) -> int:
    """The whole number in a text, from 0 to high where that is given."""
    if text is not None:
        try:
            number = integer(text)
        except ValueError:
            pass
        else:
            if high is None or 0 <= number <= high:
                return number
    must = "a whole number" if high is None else f"a whole number from 0 to {high}"
    quoted = "missing" if text is None else repr(text)
    raise ValueError(f"{place} = {quoted}: must be {must}")
