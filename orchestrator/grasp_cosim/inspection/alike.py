"""Which variable of a foreign FMU is meant by one of a system: by name, symbol, unit and text.

GapRight and GapLeft are gap[1] and gap[2], and so are l_1 and l_2, or the elements of an array: x
points right, and finger 1 is the right one. Each pair of variables has one score, and the pairs
that are taken have the greatest sum of scores (scipy.optimize.linear_sum_assignment).
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from difflib import SequenceMatcher
from typing import NamedTuple

import numpy as np

from ..interface.interface import Interface, Variable

LEAST = 0.3
"""Below this score nothing is proposed."""

OF_UNIT = 0.3
"""The score of units that convert, on top of that of the names, of which 1 needs no check."""

_NUMBERS = {
    "right": 1,
    "r": 1,
    "rh": 1,
    "one": 1,
    "a": 1,
    "left": 2,
    "l": 2,
    "lh": 2,
    "two": 2,
    "b": 2,
}
"""Words for 1 and 2."""

_UNSURE = ("one", "two", "a", "b")
"""Those of which which is which needs a check."""

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


Score = tuple[float, str]
"""How much a variable is like another, from 0 on, and why that is to be checked."""

NOTHING: Score = (0.0, "")


def matches(ours: Interface, wanted: Collection[str], theirs: Interface) -> dict[str, Match]:
    """For variables of ours, by name, those of another FMU that are meant; each at most once.

    None where two are as much alike as each other.
    """
    from scipy.optimize import linear_sum_assignment  # only here: it takes time to load

    left, others = _usable(ours), _usable(theirs)
    mine, its = _readings(left), _readings(others)
    scores = [
        [_score(ours, v, mine[v.name][-1], theirs, w, its[w.name]) for w in others] for v in left
    ]
    values = np.array([[score[0] for score in row] for row in scores])
    values = values.reshape(len(left), len(others))
    found = {}
    for i, j in zip(*linear_sum_assignment(values, maximize=True), strict=True):
        same = np.isclose(values, values[i, j])
        alone = same[i].sum() + same[:, j].sum() == 2
        if left[i].name in wanted and values[i, j] >= LEAST and alone:
            found[left[i].name] = Match(others[j], scores[i][j][1])
    return found


def _usable(interface: Interface) -> list[Variable]:
    """The variables that can be connected, set or recorded."""
    variables = interface.of("input", "output", "parameter")
    return [v for v in variables if v.supported and not v.alias]


def _score(
    ours: Interface, v: Variable, mine: _Reading, theirs: Interface, w: Variable,
    readings: Iterable[_Reading],
) -> Score:  # fmt: skip
    """The best score of two variables over the ways to read the name of the second."""
    units = ours.unit(v), theirs.unit(w)
    if (v.kind, v.causality) != (w.kind, w.causality):
        return NOTHING
    if units[0] and units[1] and not units[0].measures(units[1]):
        return NOTHING
    known = bool(units[0] and units[1]) or v.kind != "Real"
    fitting = (r for r in readings if (r.number, r.many) == (mine.number, mine.many))
    found = (_of_names(mine, reading, v, w, known) for reading in fitting)
    return max(found, key=lambda s: (s[0], not s[1]), default=NOTHING)


def _of_names(a: _Reading, b: _Reading, v: Variable, w: Variable, known: bool) -> Score:
    """The score of two readings; `known` says that their units, or types, speak for it."""
    meant, other = _meaning(a.words), _meaning(b.words)
    more = OF_UNIT if known else 0.0
    unsure = "" if b.certain else "which is 1, which 2"
    if _plural(a.words) == _plural(b.words):
        return 1.1 + more, unsure
    if meant == other:
        return 1.0 + more, unsure
    if _symbol(v) == "".join(word for word in b.words if word not in _NOISE):
        return 0.95 + more, unsure if known else "by its name"
    name = 0.7 * SequenceMatcher(None, sorted(meant), sorted(other)).ratio()
    told = [m for m, of in ((meant, w), (other, v)) if m <= _meaning(_words(of.description or ""))]
    text = max((0.3 + 0.1 * len(m) for m in told), default=0.0)
    if name == text == 0.0:
        return NOTHING
    return max(name, text) + more, "by its name" if name >= text else "by its description"


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
        for rest, number, _ in found:
            numbers.setdefault(rest, set()).add(number)

    def readings(v: Variable) -> Iterator[_Reading]:
        words = _words(v.name)
        yield _Reading(words, None, True)
        for rest, number, certain in numbered[v.name]:
            from_0, many = 0 in numbers[rest], len(numbers[rest])
            if many > 1:
                words = _words(v.name if rest.startswith("text: ") else rest)
                yield _Reading(words, number + from_0, certain and not from_0, many)

    return {v.name: [*readings(v)] for v in variables}


def _numbered(variable: Variable) -> Iterator[tuple[str, int, bool]]:
    """The numbers in a name or description: what is left of that, the number, if it is for sure."""
    name, text = variable.name, variable.description or ""
    for match in _WORD.finditer(text):
        if number := _NUMBERS.get(match[0].lower()):
            yield f"text: {text[: match.start()]} {text[match.end() :]}", number, False
    for match in _WORD.finditer(name):
        word, rest = match[0].lower(), f"{name[: match.start()]} {name[match.end() :]}"
        if number := _NUMBERS.get(word):
            yield rest, number, word not in _UNSURE
        if word.isdecimal() and len(word) < 6:
            yield rest, int(word), True


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
