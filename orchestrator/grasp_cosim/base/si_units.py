"""Units: what FMI defines one by, and those that are known by names. Standard library only."""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache

BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


@dataclass(frozen=True, slots=True)
class Unit:
    """Value in base units = factor * value + offset; exponents in the order of BASE."""

    name: str
    exponents: tuple[int, ...]
    factor: float = 1.0
    offset: float = 0.0

    @property
    def si(self) -> bool:
        """True if its values are those in base units."""
        return (self.factor, self.offset) == (1.0, 0.0)

    @property
    def without_offset(self) -> "Unit":
        """The unit of differences."""
        return replace(self, offset=0.0) if self.offset else self

    @property
    def base(self) -> str:
        """The name of the coherent unit of SI for the same quantity: "m", "N", "kg.m2/s3"."""
        powers = dict(zip(BASE, self.exponents, strict=True))
        for symbol, (power, of) in _SI.items():
            if not power and {**dict.fromkeys(BASE, 0), **of} == powers:
                return symbol
        above, below = (
            [f"{b}{abs(n) if abs(n) > 1 else ''}" for b, n in powers.items() if n * sign > 0]
            for sign in (1, -1)
        )
        under = ".".join(below)
        under = f"({under})" if len(below) > 1 else under
        return (".".join(above) or "1") + (f"/{under}" if under else "")

    def reversed(self, name: str) -> "Unit":
        """The unit, by another name, of values with the other sign."""
        return replace(self, name=name, factor=-self.factor)

    def measures(self, other: "Unit") -> bool:
        """True if both are of one quantity; an angle is a number, as many tools define it."""
        return self.exponents[:-1] == other.exponents[:-1]


PREFIXES = {
    "f": -15, "p": -12, "n": -9, "u": -6, "µ": -6, "m": -3, "c": -2, "d": -1, "": 0, "h": 2, "k": 3,
    "M": 6, "G": 9, "T": 12,
}  # fmt: skip
"""Powers of ten; not those that make PS or at of what other units are called."""

_SI = {
    "m": (0, {"m": 1}), "g": (-3, {"kg": 1}), "s": (0, {"s": 1}), "A": (0, {"A": 1}),
    "K": (0, {"K": 1}), "mol": (0, {"mol": 1}), "cd": (0, {"cd": 1}), "rad": (0, {"rad": 1}),
    "sr": (0, {"rad": 2}), "Hz": (0, {"s": -1}), "N": (0, {"kg": 1, "m": 1, "s": -2}),
    "Pa": (0, {"kg": 1, "m": -1, "s": -2}), "bar": (5, {"kg": 1, "m": -1, "s": -2}),
    "J": (0, {"kg": 1, "m": 2, "s": -2}), "W": (0, {"kg": 1, "m": 2, "s": -3}),
    "C": (0, {"A": 1, "s": 1}), "V": (0, {"kg": 1, "m": 2, "s": -3, "A": -1}),
    "F": (0, {"kg": -1, "m": -2, "s": 4, "A": 2}),
    "Ohm": (0, {"kg": 1, "m": 2, "s": -3, "A": -2}),
    "S": (0, {"kg": -1, "m": -2, "s": 3, "A": 2}),
    "Wb": (0, {"kg": 1, "m": 2, "s": -2, "A": -1}), "T": (0, {"kg": 1, "s": -2, "A": -1}),
    "H": (0, {"kg": 1, "m": 2, "s": -2, "A": -2}), "lm": (0, {"cd": 1}),
    "lx": (0, {"cd": 1, "m": -2}), "Bq": (0, {"s": -1}), "Gy": (0, {"m": 2, "s": -2}),
    "Sv": (0, {"m": 2, "s": -2}), "kat": (0, {"mol": 1, "s": -1}), "l": (-3, {"m": 3}),
    "L": (-3, {"m": 3}),
}  # fmt: skip
"""Symbols that take a prefix: a power of ten, and powers of base units."""

OTHER = {
    "1": (1.0, 0.0, {}), "-": (1.0, 0.0, {}), "%": (0.01, 0.0, {}),
    "deg": (math.pi / 180.0, 0.0, {"rad": 1}), "rev": (2.0 * math.pi, 0.0, {"rad": 1}),
    "rpm": (math.pi / 30.0, 0.0, {"rad": 1, "s": -1}), "degC": (1.0, 273.15, {"K": 1}),
    "degF": (5.0 / 9.0, 273.15 - 32.0 * 5.0 / 9.0, {"K": 1}), "min": (60.0, 0.0, {"s": 1}),
    "h": (3600.0, 0.0, {"s": 1}), "d": (86400.0, 0.0, {"s": 1}), "t": (1e3, 0.0, {"kg": 1}),
    "in": (0.0254, 0.0, {"m": 1}), "ft": (0.3048, 0.0, {"m": 1}),
    "lb": (0.45359237, 0.0, {"kg": 1}),
    "lbf": (4.4482216152605, 0.0, {"kg": 1, "m": 1, "s": -2}),
}  # fmt: skip
"""Symbols without a prefix: factor, offset, powers of base units."""

_SIGNS = str.maketrans({
    "°": "deg", "Ω": "Ohm", "\u2126": "Ohm", "\u03bc": "µ", "⁻": "-", "¹": "1", "²": "2", "³": "3",
})  # fmt: skip
"""Signs and how the names above have them; two are of the ohm, one is a Greek mu."""

_FACTOR = re.compile(r"(1|-|[^\d\s.*·/^()+-]+)(?:(?<![1-])\^?([+-]?\d))?")
_PRODUCT = re.compile("[.*·]")
_UNIT = re.compile(r"([^/()]+)(?:/(?:([^/()]+)|\(([^/()]+)\)))?")


@lru_cache(maxsize=256)
def known_unit(name: str) -> Unit | None:
    """The unit of a name, without a definition: SI with prefixes, deg, degC, min, h, %, rpm, ...

    Products, powers and a quotient are as FMI writes them: N.s/m, m/s2, J/(kg.K); or with signs
    like °C and m/s². None where it is no such name.
    """
    parts = _UNIT.fullmatch(name.translate(_SIGNS))
    if parts is None:
        return None
    above, single, several = parts.groups()
    below = single or several
    if single and _PRODUCT.search(single):
        return None  # N/m.s: as (m.s) or as .s, which is not said
    factors = [(text, 1) for text in _PRODUCT.split(above)]
    factors += [(text, -1) for text in _PRODUCT.split(below)] if below else []
    scale, offset, ten, exponents = 1.0, 0.0, 0, [0] * len(BASE)
    for text, sign in factors:
        symbol = _symbol(text)
        if symbol is None:
            return None
        factor, shift, power_of_ten, base, power = symbol
        scale *= factor ** (sign * power)
        ten += sign * power * power_of_ten
        offset = shift if len(factors) == 1 and power == 1 else 0.0
        for i, key in enumerate(BASE):
            exponents[i] += sign * power * base.get(key, 0)
    scale *= float(f"1e{ten}")
    return Unit(name, tuple(exponents), scale, offset) if 0.0 < scale < math.inf else None


def spelt_like(name: str, defined: Iterable[str]) -> list[str]:
    """The units, of those defined or known, that differ from a name in capitals only: kN of KN."""
    prefixed = (f"{prefix}{symbol}" for symbol in _SI for prefix in PREFIXES)
    matches = (unit for unit in (*defined, *prefixed, *OTHER) if unit.lower() == name.lower())
    return [*dict.fromkeys(matches)]


def refusal(name: str) -> str:
    """Why a name is no unit, and which may be meant; empty for one that is, also for V.m^n."""
    if known_unit(re.sub(r"\^[A-Za-z]\w*", "", name)):  # an exponent that is a parameter
        return ""
    dotted = (f"{name[:i]}.{name[i:]}" for i in range(1, len(name)))
    meant = next((unit for unit in (*dotted, *spelt_like(name, ())) if known_unit(unit)), None)
    fix = f"did you mean {meant}?" if meant else "must be one like N, kg, m/s2, N.s/m"
    return f"unit {name!r} is not known; {fix}"


def _symbol(text: str) -> tuple[float, float, int, dict[str, int], int] | None:
    """Factor, offset, power of ten and base units of a symbol like mm, and its power."""
    match = _FACTOR.fullmatch(text)
    if match is None:
        return None
    symbol, power = match[1], int(match[2] or 1)
    if symbol in OTHER:
        factor, offset, base = OTHER[symbol]
        return factor, offset, 0, base, power
    for end, (ten, base) in _SI.items():
        prefix = symbol.removesuffix(end)
        if symbol.endswith(end) and prefix in PREFIXES:
            return 1.0, 0.0, ten + PREFIXES[prefix], base, power
    return None
