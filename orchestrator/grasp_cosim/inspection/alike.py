"""Which variable of a foreign FMU is meant by one of a system: by its name, number and unit.

GapRight and GapLeft are gap[1] and gap[2], and so are l_1 and l_2, or the elements of an array: x
points right, and finger 1 is the right one. The very name comes first, then the same words, then
words of the same meaning; what is left may have a word more or less, which is to be checked.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

from ..interface.interface import Interface
from ..interface.variables import Variable

_NUMBERS = {
    **dict.fromkeys(("1", "right", "r", "rh", "a"), 1),
    **dict.fromkeys(("2", "left", "l", "lh", "b"), 2),
}
"""Words for 1 and 2; of a and b which is which needs a check."""

_SAME = {
    "gap": "distance dist clearance separation spacing proximity l",
    "position": "pos x displacement location coordinate",
    "velocity": "vel speed v xd xdot dx vx",
    "force": "frc f effort thrust load",
    "contact": "touch touching touches touched contacting collision normal reaction c",
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

_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[^\W\d_]+|\d+")


@dataclass(frozen=True, slots=True)
class Match:
    """The variable of the FMU that is meant; doubt is why that is to be checked, empty if not."""

    variable: Variable
    doubt: str

    @property
    def check(self) -> str:
        """What the file says of a doubt."""
        return f"CHECK, found {self.doubt}; " if self.doubt else ""


class _Reading(NamedTuple):
    """A variable, with its name read as that of a number, of so many, or of no number."""

    variable: Variable
    text: str
    """What is left of its name without the number."""
    number: int | None = None
    many: int = 1
    doubt: str = ""

    @property
    def place(self) -> tuple[int | None, int]:
        """Which one it is, and of how many."""
        return self.number, self.many

    @property
    def words(self) -> tuple[str, ...]:
        """The words of its name, as they stand there."""
        return _words(self.text)

    @property
    def meaning(self) -> frozenset[str]:
        """The meanings of its words."""
        return _meaning(self.text)


def matches(ours: Interface, theirs: Interface) -> dict[str, Match]:
    """For variables of ours, by name, those of another FMU that are meant; each at most once.

    None where two are as much alike as each other.
    """
    found: dict[str, Match] = {}

    def pair(alike: Callable[[_Reading, _Reading], bool], doubt: str = "") -> None:
        taken = {match.variable.name for match in found.values()}
        left = {v: r for v, r in mine.items() if v not in found}
        pairs = {
            (v, r.variable.name): Match(r.variable, r.doubt or doubt)
            for v, own in left.items()
            for r in its
            if r.variable.name not in taken and own.place == r.place and alike(own, r)
            if _may_be(ours, own.variable, theirs, r.variable)
        }
        ends = Counter(name for key in pairs for name in zip("ab", key, strict=True))
        for (v, w), match in pairs.items():
            if ends["a", v] == ends["b", w] == 1:
                found[v] = match

    # of ours the likeliest reading, a number where there is one
    mine = {r.variable.name: r for r in _readings(ours)}
    its = [*_readings(theirs)]
    pair(lambda a, b: a.variable.name == b.variable.name)
    pair(lambda a, b: a.words == b.words)
    pair(lambda a, b: a.meaning == b.meaning)
    pair(lambda a, b: a.meaning < b.meaning or a.meaning > b.meaning, "by its name")
    return found


def _may_be(ours: Interface, v: Variable, theirs: Interface, w: Variable) -> bool:
    """True if w could be v: of the same causality, type and quantity, by its unit or else its name.

    An Integer output, 0 or 1, could be a Boolean one that is only recorded.
    """
    flag = (v.causality, v.kind, w.kind) == ("output", "Boolean", "Integer")
    if v.causality != w.causality or (v.kind != w.kind and not flag):
        return False
    if (unit := ours.unit(v)) and (other := theirs.unit(w)):
        return unit.measures(other)
    meant, its = (_meaning(name) & _SAME.keys() for name in (v.name, w.name))
    return not its or not meant or bool(its & meant)


def _readings(interface: Interface) -> Iterator[_Reading]:
    """The ways to read the names of what can be connected, set or recorded; the likeliest last.

    Only what there is a 1 and a 2 of is numbered. Where the numbers begin with 0 they are one less,
    which is not for sure.
    """
    usable = interface.of("input", "output", "parameter")
    variables = [v for v in usable if v.supported and not v.alias]
    numbers: dict[str, set[int]] = {}
    for v in variables:
        for rest, _, number in _numbered(v.name):
            numbers.setdefault(rest, set()).add(number)
    for v in variables:
        yield _Reading(v, v.name)
        for rest, word, number in _numbered(v.name):
            all_ = numbers[rest]
            doubt = "which is 1, which 2" if 0 in all_ or word in ("a", "b") else ""
            if len(all_) > 1:
                yield _Reading(v, rest, number + (0 in all_), len(all_), doubt)


def _numbered(name: str) -> Iterator[tuple[str, str, int]]:
    """The numbers in a name: what is left of it, the word, and the number."""
    for match in _WORD.finditer(name):
        word, rest = match[0].lower(), f"{name[: match.start()]} {name[match.end() :]}"
        if word in _NUMBERS or (word.isdecimal() and len(word) < 6):
            yield rest, word, _NUMBERS.get(word) or int(word)


def candidates(
    ours: Interface, name: str, theirs: Interface, taken: Collection[str]
) -> list[Variable]:
    """The variables of another FMU, other than those taken, that could be one of ours."""
    variable, others = ours.by_name[name], {*taken, *theirs.main_names}
    free = (v for v in theirs.variables if v.name not in others)
    return [v for v in free if v.supported and _may_be(ours, variable, theirs, v)]


@cache
def _words(name: str) -> tuple[str, ...]:
    """The words in a name, in small letters."""
    return tuple(word.lower() for word in _WORD.findall(name))


@cache
def _meaning(name: str) -> frozenset[str]:
    """The meanings of the words in a name; of those that say nothing if there are no others."""
    words = _words(name)
    plain = [w if w in _MEANING or w.endswith("ss") else w.removesuffix("s") for w in words]
    telling: Iterable[str] = [w for w in plain if w not in _NOISE] or plain
    return frozenset(_MEANING.get(w, w) for w in telling if not w.isdigit())
