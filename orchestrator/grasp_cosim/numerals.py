"""Numbers for the eye."""

MOST = 1e9
"""The size from which a number in a table is written with a power of ten."""


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
    """Return `value` with so many decimals; where it has no place there, like 4.04e+41 or 6.3e-15.

    That is from `most` on and, unless it is `rounded` to 0, where all its decimals would be 0; it
    then has up to so many digits. `width` and `sign` ("+" for both) are those of a format.
    """
    least = 0.0 if rounded else 0.5 * 10.0**-decimals
    if not value or least <= abs(value) < most:
        return f"{value:{sign}{width}.{decimals}f}"
    return f"{value:{sign}{width}.{digits}g}"
