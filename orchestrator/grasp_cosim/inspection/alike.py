"""Which variable of a foreign FMU is meant by one of a system: by name, symbol, unit and text.

GapRight and GapLeft are gap[1] and gap[2], and so are l_1 and l_2, or the elements of an array: x
points right, and finger 1 is the right one. Each pair of variables has one score, and the pairs
that are taken have the greatest sum of scores (scipy.optimize.linear_sum_assignment).
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from difflib import SequenceMatcher
from typing import NamedTuple

import numpy as np

from ..interface.interface import Interface, Variable

CERTAIN = 1.0
"""From this score of a name on it needs no check."""

LEAST = 0.3
"""Below this score nothing is proposed."""

OF_UNIT = 0.3
"""The score of units that convert, on top of that of the names."""

_SIDES = (
    (("right", "left"), True),
    (("r", "l"), True),
    (("rh", "lh"), True),
    (("first", "second"), False),
    (("one", "two"), False),
    (("a", "b"), False),
)
"""Words for 1 and 2; if that needs no check."""

_GLUED = ("r", "l")
"""Letters for 1 and 2 at the end of a word, as in gapr and gapl."""

_SAME = {
    "gap": "distance dist clearance separation spacing proximity",
    "position": "pos x displacement location coordinate",
    "velocity": "vel speed v xd xdot dx vx",
    "force": "frc f effort thrust load",
    "contact": "touch touching touches touched contacting collision normal reaction",
    "object": "obj workpiece part item",
    "width": "w thickness",
    "initial": "init start x0",
    "mass": "m weight",
    "damping": "damper",
    "stiffness": "spring",
    "intensity": "xi light brightness",
    "reflectance": "albedo reflectivity alpha",
    "enabled": "enable on",
}
_MEANING = {word: meaning for meaning, words in _SAME.items() for word in (meaning, *words.split())}
_SILENT = (
    "plant gripper finger fingertip tip sensor controller hand the a of on to from between and is "
    "out output in input actual act measured meas value val signal cmd command current"
)
_NOISE = frozenset(_SILENT.split())
"""Words that say nothing of a quantity."""

_KNOWN = frozenset(_MEANING) | _NOISE

_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[^\W\d_]+|\d+")
_SYMBOL = re.compile(r"[^\W\d]\w{0,5}")


@dataclass(frozen=True, slots=True)
class Match:
    """The variable of the FMU that is meant; doubt is why that is to be checked, empty if not."""

    variable: Variable
    doubt: str


class _Reading(NamedTuple):
    """A name read as that of a number, of so many, or of no number; certain if that is for sure."""

    words: tuple[str, ...]
    number: int | None
    certain: bool
    many: int = 1


class _Score(NamedTuple):
    """How much a variable is like another, from 0 on, and why that is to be checked."""

    value: float
    doubt: str


NOTHING = _Score(0.0, "")


def matches(ours: Interface, wanted: Collection[str], theirs: Interface) -> dict[str, Match]:
    """For variables of ours, by name, those of another FMU that are meant; each at most once.

    None where two are as much alike as each other, and by its unit alone only where all of an
    array are found so.
    """
    left, others = [*_usable(ours)], [*_usable(theirs)]
    read = _readings(left), _readings(others)
    scores = [
        [_score(ours, v, read[0][v.name][-1:], theirs, w, read[1][w.name]) for w in others]
        for v in left
    ]
    values = np.array([[score.value for score in row] for row in scores]).reshape(
        len(left), len(others)
    )
    found = {
        left[i].name: Match(others[j], scores[i][j].doubt)
        for i, j in _assigned(values)
        if values[i, j] >= LEAST and _is_alone(values, i, j)
    }
    return {n: m for n, m in _whole(left, found).items() if n in wanted}


def _assigned(values: np.ndarray) -> Iterator[tuple[int, int]]:
    """The pairs with the greatest sum."""
    from scipy.optimize import linear_sum_assignment  # only here: it takes time to load

    yield from zip(
        *map(np.ndarray.tolist, linear_sum_assignment(values, maximize=True)), strict=True
    )


def _is_alone(values: np.ndarray, i: int, j: int) -> bool:
    """True if nothing else is as much alike."""
    same = np.isclose(values, values[i, j])
    return int(same[i].sum() + same[:, j].sum()) == 2


def _whole(left: Iterable[Variable], found: Mapping[str, Match]) -> dict[str, Match]:
    """Without what only its unit tells, unless all of its name but the number are found so."""
    stems = {v.name: _words(v.name) for v in left}
    several = {n: [m for m in stems if _stem(stems[m]) == _stem(stems[n])] for n in found}
    return {
        name: match
        for name, match in found.items()
        if match.doubt != BY_UNIT or all(other in found for other in several[name])
    }


BY_UNIT = "the only one of its unit and type"


def _stem(words: Iterable[str]) -> tuple[str, ...]:
    return tuple(w for w in words if not w.isdigit())


def _usable(interface: Interface) -> Iterator[Variable]:
    """The variables that can be connected, set or recorded."""
    for v in interface.of("input", "output", "parameter"):
        if v.supported and not v.alias:
            yield v


def _score(
    ours: Interface, v: Variable, mine: Iterable[_Reading], theirs: Interface, w: Variable,
    readings: Iterable[_Reading],
) -> _Score:  # fmt: skip
    """The best score of two variables over the ways to read their names."""
    units = ours.unit(v), theirs.unit(w)
    if (v.kind, v.causality) != (w.kind, w.causality):
        return NOTHING
    if units[0] and units[1] and not units[0].measures(units[1]):
        return NOTHING
    known = bool(units[0] and units[1]) or v.kind != "Real"
    pairs = ((a, b) for a in mine for b in readings if (a.number, a.many) == (b.number, b.many))
    found = (_of_names(a, b, v, w, known) for a, b in pairs)
    return max(found, key=lambda s: (s.value, not s.doubt), default=NOTHING)


def _of_names(a: _Reading, b: _Reading, v: Variable, w: Variable, known: bool) -> _Score:
    """The score of two readings; `known` says that their units, or types, speak for it."""
    meant, other = _meaning(a.words), _meaning(b.words)
    more = OF_UNIT if known else 0.0
    unsure = "" if b.certain else "which is 1, which 2"
    if _plural(a.words) == _plural(b.words):
        return _Score(1.1 + more, unsure)
    if meant == other:
        return _Score(CERTAIN + more, unsure)
    symbol = _symbol(v) == "".join(word for word in b.words if word not in _NOISE)
    if symbol:
        return _Score(0.95 + more, unsure if known else "by its name")
    name = 0.7 * SequenceMatcher(None, sorted(meant), sorted(other)).ratio()
    told = [m for m, of in ((meant, w), (other, v)) if m <= _told(of)]
    text = max((0.3 + 0.1 * len(m) for m in told), default=0.0)
    if max(name, text) > 0.0:
        doubt = "by its name" if name >= text else "by its description"
        return _Score(max(name, text) + more, doubt)
    means_another = bool(other & _SAME.keys())
    return NOTHING if means_another else _Score(more, BY_UNIT)


def _told(v: Variable) -> frozenset[str]:
    """The words of a description, by their meaning."""
    return _meaning(_words(v.description or ""))


def _symbol(v: Variable) -> str:
    """The symbol that begins a description, 'l_j, distance ...', without its index j."""
    match = _SYMBOL.match((v.description or "").partition(",")[0])
    return match[0].replace("_", "").lower().removesuffix("j") if match else ""


def _readings(variables: Collection[Variable]) -> dict[str, list[_Reading]]:
    """The ways to read each name, by name: first without a number, last with the likeliest one.

    Only what there is a 1 and a 2 of is numbered. Where the numbers begin with 0 they are one less,
    which is not for sure.
    """
    numbered = {v.name: [*_numbered(v)] for v in variables}
    numbers: dict[str, set[int]] = {}
    for found in numbered.values():
        for rest, reading in found:
            numbers.setdefault(rest, set()).add(reading.number or 0)

    def meant(rest: str, reading: _Reading) -> _Reading:
        least, many = min(numbers[rest]), len(numbers[rest])
        if least:
            return reading._replace(many=many)
        return reading._replace(number=(reading.number or 0) + 1, certain=False, many=many)

    return {
        v.name: [
            _Reading(_words(v.name), None, True),
            *(meant(rest, r) for rest, r in numbered[v.name] if len(numbers[rest]) > 1),
        ]
        for v in variables
    }


def candidates(
    ours: Interface, name: str, theirs: Interface, taken: Collection[str]
) -> list[Variable]:
    """The variables of another FMU, other than those taken, that could be one of ours.

    An Integer output, 0 or 1, could be a Boolean one that is only recorded.
    """
    variable = ours.by_name[name]
    unit = ours.unit(variable)
    flag = (variable.kind, variable.causality) == ("Boolean", "output")
    return [
        v
        for v in theirs.of(variable.causality)
        if v.supported and v.name not in taken
        if v.kind == variable.kind or (flag and v.kind == "Integer")
        if (unit.measures(other) if unit and (other := theirs.unit(v)) else _may_be(variable, v))
    ]


def _may_be(variable: Variable, other: Variable) -> bool:
    """False where the name of another variable, of no unit, is that of another quantity."""
    ours, theirs = (_meaning(_words(v.name)) & _SAME.keys() for v in (variable, other))
    return not theirs or bool(ours & theirs) or not ours


def _numbered(variable: Variable) -> Iterator[tuple[str, _Reading]]:
    """The ways to read a name or description as a numbered one, after what is left of it."""
    name, text = variable.name, variable.description or ""
    for match in _WORD.finditer(text):
        for sides, _ in _SIDES:
            if (word := match[0].lower()) in sides:
                said = f"{text[: match.start()]} {text[match.end() :]}"
                yield f"text: {said}", _Reading(_words(name), 1 + sides.index(word), False)
    for match in _WORD.finditer(name):
        word, rest = match[0].lower(), f"{name[: match.start()]} {name[match.end() :]}"
        if len(word) > 1 and word[-1] in _GLUED:
            glued = f"{name[: match.end() - 1]} {name[match.end() :]}"
            yield glued, _Reading(_words(glued), 1 + _GLUED.index(word[-1]), False)
        for sides, certain in _SIDES:
            if word in sides:
                yield rest, _Reading(_words(rest), 1 + sides.index(word), certain)
        if word.isdecimal() and len(word) < 6:
            yield rest, _Reading(_words(rest), int(word), True)


def _words(name: str) -> tuple[str, ...]:
    """The words of a name like GapRight, gap_right or contactforce, in small letters."""
    return tuple(part for word in _WORD.findall(name) for part in _parts(word.lower()))


def _parts(word: str) -> Iterable[str]:
    """A word that is written as one with another, taken apart where both are known."""
    if word in _KNOWN or word.rstrip("s") in _KNOWN:
        return [word]
    splits = ((word[:i], word[i:]) for i in range(3, len(word) - 2))
    return next((pair for pair in splits if _KNOWN.issuperset(pair)), [word])


def _plural(words: Iterable[str]) -> tuple[str, ...]:
    return tuple(w if w in _MEANING or w.endswith("ss") else w.removesuffix("s") for w in words)


def _meaning(words: Iterable[str]) -> frozenset[str]:
    """The meanings of words; of those that say nothing all, where there are no others."""
    plain = _plural(words)
    telling = [w for w in plain if w not in _NOISE] or plain
    return frozenset(_MEANING.get(w, w) for w in telling if not w.isdigit())
