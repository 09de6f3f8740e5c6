"""Numbers for the eye."""

from math import degrees

MOST = 1e9
"""The size from which a number in a table is written with a power of ten."""

NOISE = 1e-10
"""What is smaller is 0 but for rounding errors, in any unit in which a table shows it."""

MILLI = {"m": (1e3, "mm"), "m/s": (1e3, "mm/s"), "N.s": (1e3, "mN.s"), "rad": (degrees(1), "deg")}
"""How values are shown in tables and pictures, by unit: times a factor, in another."""


def in_milli(unit: str | None) -> tuple[float, str]:
    """Return the factor and the unit in which values of `unit` are shown; "" for a mere number."""
    return MILLI.get(unit or "", (1.0, "" if unit in (None, "1") else str(unit)))


def counted(count: int, noun: str) -> str:
    """Return a count with its noun, which takes an s unless it is 1: `1 fault`, `2 faults`."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def fixed(
    value: float,
    decimals: int,
    *,
    width: int = 0,
    sign: str = "",
    most: float = MOST,
    digits: int = 4,
    rounded: bool = False,
) -> str:
    """Return `value` with so many decimals; where it has no place there, like 4.04e+41 or 6.3e-5.

    That is from `most` on and, unless it is `rounded` to 0, where all its decimals would be 0; it
    then has up to so many digits. `width` and `sign` ("+" for both) are those of a format.
    """
    least = 0.0 if rounded else 0.5 * 10.0**-decimals
    value = 0.0 if abs(value) < NOISE else value
    if not value or least <= abs(value) < most:
        return f"{value:{sign}{width}.{decimals}f}"
    return f"{value:{sign}{width}.{digits}g}"


def significant(value: float | None, digits: int = 6, none: str = "none") -> str:
    """Return a number with so many significant digits; `none` where there is none."""
    return none if value is None else f"{value:.{digits}g}"


def grouped(value: float, decimals: int = 0) -> str:
    """Return a number in groups of three digits."""
    return f"{value:,.{decimals}f}".replace(",", "\N{NARROW NO-BREAK SPACE}")
