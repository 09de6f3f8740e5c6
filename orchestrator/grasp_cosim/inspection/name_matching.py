"""Which variable of a foreign FMU is meant by one of a system: by its name, number and unit.

GapRight and GapLeft are gap[1] and gap[2], and so are l_1 and l_2, or the elements of an array: x
points right, and finger 1 is the right one. Equal names are matched first, then names of the same
words, then names whose words mean the same. Of the remaining ones a name may have some words more
or less, which the user has to check.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

from ..interface.interface import Interface
from ..interface.variables import Variable

_NUMBER_WORDS = {
    **dict.fromkeys(("1", "right", "r", "rh", "a"), 1),
    **dict.fromkeys(("2", "left", "l", "lh", "b"), 2),
}
"""Words for 1 and 2. With a and b the user has to check which is which."""

_SYNONYMS = {
    "gap": "distance dist clearance separation spacing proximity l",
    "position": "pos x displacement location coordinate",
    "velocity": "vel speed v xd xdot dx vx",
    "force": "frc f effort thrust load",
    "contact": "touch touching touches contacting collision normal reaction c",
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
"""Words in the names of foreign variables, by the quantity that they mean."""

_MEANINGS = {quantity: quantity for quantity in _SYNONYMS} | {
    word: quantity for quantity, words in _SYNONYMS.items() for word in words.split()
}
_FILLER_TEXT = (
    "plant gripper finger fingertip tip sensor controller hand the a of on to from between and is "
    "out output in input actual act measured meas value val signal cmd command current"
)
_FILLERS = frozenset(_FILLER_TEXT.split())
"""Words that say nothing of a quantity."""

_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[^\W\d_]+|\d+")

_MAX_NUMBER_DIGITS = 5
"""Of more digits, like those of a date, a number in a name is not that of a finger."""


@dataclass(frozen=True, slots=True)
class Match:
    """The foreign variable that is meant; `doubt` is why that is to be checked, empty if not."""

    variable: Variable
    doubt: str

    @property
    def check_comment(self) -> str:
        """The words on the doubt in a comment of the file, ahead of those on the variable."""
        return f"CHECK, found {self.doubt}; " if self.doubt else ""


class _Reading(NamedTuple):
    """One way to read the name of a variable: `stem` without the number that stands in it.

    The number is that of one of `total` variables that differ in it; None where none is read.
    """

    variable: Variable
    stem: str
    number: int | None = None
    total: int = 1
    doubt: str = ""


class _NumberInName(NamedTuple):
    """A number, or a word for one, in a name, and the stem that the name is without it."""

    stem: str
    word: str
    number: int


def match_variables(old: Interface, foreign: Interface) -> dict[str, Match]:
    """For variables of the `old` FMU, by name, those of a foreign FMU that are meant.

    Each foreign variable is meant at most once. A variable has no match where two are as much
    alike as each other.
    """
    # Of the readings of an old name the last one, with a number where there is one, is likeliest.
    old_readings = {reading.variable.name: reading for reading in _readings(old)}
    foreign_readings = list(_readings(foreign))
    pairs = [
        (reading, candidate)
        for reading in old_readings.values()
        for candidate in foreign_readings
        if (reading.number, reading.total) == (candidate.number, candidate.total)
        and _could_be(old, reading.variable, foreign, candidate.variable)
    ]
    matches: dict[str, Match] = {}
    for are_alike, doubt in _LIKENESSES:
        taken = {match.variable.name for match in matches.values()}
        alike = [
            (reading, candidate)
            for reading, candidate in pairs
            if reading.variable.name not in matches
            and candidate.variable.name not in taken
            and are_alike(reading, candidate)
        ]
        matches |= _unambiguous_matches(alike, doubt)
    return matches


def _unambiguous_matches(
    pairs: Sequence[tuple[_Reading, _Reading]], doubt: str
) -> dict[str, Match]:
    """The matches, by the old name, of pairs in which neither name could go with another one."""
    matches = {
        (reading.variable.name, candidate.variable.name): Match(
            candidate.variable, candidate.doubt or doubt
        )
        for reading, candidate in pairs
    }
    old_counts = Counter(old_name for old_name, _ in matches)
    foreign_counts = Counter(foreign_name for _, foreign_name in matches)
    return {
        old_name: match
        for (old_name, foreign_name), match in matches.items()
        if old_counts[old_name] == foreign_counts[foreign_name] == 1
    }


def _have_equal_names(reading: _Reading, candidate: _Reading) -> bool:
    return reading.variable.name == candidate.variable.name


def _have_equal_words(reading: _Reading, candidate: _Reading) -> bool:
    return _words(reading.stem) == _words(candidate.stem)


def _mean_the_same(reading: _Reading, candidate: _Reading) -> bool:
    return _meanings(reading.stem) == _meanings(candidate.stem)


def _mean_more_or_less(reading: _Reading, candidate: _Reading) -> bool:
    """True if all words of one name are among those of the other, by their meanings."""
    meanings, candidate_meanings = _meanings(reading.stem), _meanings(candidate.stem)
    return meanings < candidate_meanings or meanings > candidate_meanings


_LIKENESSES: tuple[tuple[Callable[[_Reading, _Reading], bool], str], ...] = (
    (_have_equal_names, ""),
    (_have_equal_words, ""),
    (_mean_the_same, ""),
    (_mean_more_or_less, "by its name"),
)
"""In which ways names may be alike, the surest first, and the doubt that is left then."""


def _could_be(old: Interface, variable: Variable, foreign: Interface, candidate: Variable) -> bool:
    """True if a foreign variable is of the same causality, type and quantity as an old one.

    The quantity is that of its unit, or else of its name. An Integer output, 0 or 1, could be a
    Boolean one that is only recorded.
    """
    kinds = (variable.kind, candidate.kind)
    is_flag = variable.causality == "output" and kinds == ("Boolean", "Integer")
    if variable.causality != candidate.causality:
        return False
    if variable.kind != candidate.kind and not is_flag:
        return False
    unit, candidate_unit = old.unit(variable), foreign.unit(candidate)
    if unit and candidate_unit:
        return unit.measures(candidate_unit)
    quantities = _meanings(variable.name) & _SYNONYMS.keys()
    candidate_quantities = _meanings(candidate.name) & _SYNONYMS.keys()
    if not quantities or not candidate_quantities:
        return True
    return not quantities.isdisjoint(candidate_quantities)


def _readings(interface: Interface) -> Iterator[_Reading]:
    """The ways to read the names of what can be connected, set or recorded; the likeliest last.

    A number is read only where there are a 1 and a 2 of the same stem. Where the numbers begin
    with 0 each is read as one more, which is not for sure.
    """
    usable = interface.of("input", "output", "parameter")
    variables = [v for v in usable if v.supported and not v.alias]
    numbers_by_stem: dict[str, set[int]] = {}
    for variable in variables:
        for stem, _, number in _numbers_in(variable.name):
            numbers_by_stem.setdefault(stem, set()).add(number)
    for variable in variables:
        yield _Reading(variable, variable.name)
        for stem, word, number in _numbers_in(variable.name):
            numbers = numbers_by_stem[stem]
            begins_at_0 = 0 in numbers
            doubt = "which is 1, which 2" if begins_at_0 or word in ("a", "b") else ""
            if len(numbers) > 1:
                number_from_1 = number + 1 if begins_at_0 else number
                yield _Reading(variable, stem, number_from_1, len(numbers), doubt)


def _numbers_in(name: str) -> Iterator[_NumberInName]:
    """The numbers in a name, from left to right."""
    for match in _WORD.finditer(name):
        word = match[0].lower()
        stem = f"{name[: match.start()]} {name[match.end() :]}"
        if word in _NUMBER_WORDS:
            yield _NumberInName(stem, word, _NUMBER_WORDS[word])
        elif word.isdecimal() and len(word) <= _MAX_NUMBER_DIGITS:
            yield _NumberInName(stem, word, int(word))


def candidates(
    old: Interface, name: str, foreign: Interface, taken: Collection[str]
) -> list[Variable]:
    """The foreign variables, other than those taken, that could be the old one of this name."""
    variable = old.by_name[name]
    excluded = {*taken, *foreign.main_names}
    return [
        candidate
        for candidate in foreign.variables
        if candidate.name not in excluded
        and candidate.supported
        and _could_be(old, variable, foreign, candidate)
    ]


@cache
def _words(name: str) -> tuple[str, ...]:
    """The words in a name, in small letters."""
    return tuple(word.lower() for word in _WORD.findall(name))


@cache
def _meanings(name: str) -> frozenset[str]:
    """The meanings of the words in a name; of fillers only where it has no other words."""
    singular = [_singular(word) for word in _words(name)]
    telling = [word for word in singular if word not in _FILLERS]
    return frozenset(
        _MEANINGS.get(word, word) for word in telling or singular if not word.isdigit()
    )


def _singular(word: str) -> str:
    """A word without the s of its plural; one that has a meaning, like vs, is as it stands."""
    if word in _MEANINGS or word.endswith("ss"):
        return word
    return word.removesuffix("s")
