"""Which variable of a foreign FMU is meant by one of a system: by name, symbol, unit and text.

Variables are compared in groups: gap[1] and gap[2] are one, and so are GapRight and GapLeft, l_1
and l_2, or the elements of an array. x points right, and finger 1 is the right one.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from si_units import Unit

from ..interface.interface import Interface, Variable

CERTAIN = 0.9
"""From this likeness on, where no other is as great, it needs no check."""

LEAST = 0.3
"""Below this likeness nothing is proposed."""

ALONE = 0.3
"""The score for the only group of its unit, type and size in both."""

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


@dataclass(frozen=True, eq=False)
class _Group:
    """Variables that differ by their number only; certain if it is one for sure."""

    words: tuple[str, ...]
    members: Mapping[int, Variable]
    certain: bool
    interface: Interface
    by_text: bool = False
    """True if descriptions alone say that they belong together."""

    @cached_property
    def first(self) -> Variable:
        return next(iter(self.members.values()))

    @cached_property
    def names(self) -> set[str]:
        return {v.name for v in self.members.values()}

    @cached_property
    def meaning(self) -> frozenset[str]:
        return _meaning(self.words)

    @cached_property
    def joined(self) -> str:
        """The words written as one, as a symbol is."""
        return "".join(w for w in self.words if w not in _NOISE)

    @cached_property
    def told(self) -> frozenset[str]:
        """The words of its description, by their meaning."""
        return _meaning(_words(self.first.description or ""))

    @cached_property
    def symbol(self) -> str:
        """The symbol that begins a description, 'l_j, distance ...', without its index j."""
        match = _SYMBOL.match((self.first.description or "").partition(",")[0])
        found = match[0].replace("_", "").lower() if match else ""
        return found.removesuffix("j")

    @cached_property
    def unit(self) -> Unit | None:
        return self.interface.unit(self.first)

    def fits(self, other: _Group) -> bool:
        """True if the one could be the other: of one type, direction, size and quantity."""
        ours, theirs = self.first, other.first
        return (
            ours.kind == theirs.kind
            and ours.causality == theirs.causality
            and self.members.keys() == other.members.keys()
            and (self.unit is None or other.unit is None or self.unit.measures(other.unit))
        )


def matches(ours: Interface, wanted: Collection[str], theirs: Interface) -> dict[str, Match]:
    """For variables of ours, by name, those of another FMU that are meant; each at most once.

    The most alike first, where two are as much alike as each other, none; of what is then left,
    those that are the only ones of their type, size and unit.
    """
    left = [g for g in _apart(_groups(ours)) if g.names & {*wanted}]
    others, result = _groups(theirs), dict[str, Match]()
    for what_is_left in (False, True):
        pairs = [(g, o) for o in others for g in left if g.fits(o)]
        count = Counter(group for pair in pairs for group in pair)
        likely = [
            (*_likeness(g, o, what_is_left and count[g] == count[o] == 1), g, o) for g, o in pairs
        ]
        done, taken = _settle(sorted(likely, key=lambda f: -f[0]), result)
        left = [g for g in left if g not in done]
        others = [o for o in others if not o.names & taken]
    return {name: match for name, match in result.items() if name in wanted}


def _settle(
    found: Sequence[tuple[float, str, _Group, _Group]], result: dict[str, Match]
) -> tuple[set[_Group], set[str]]:
    """Add the matches of the most alike; what of ours, and of the other FMU, is settled by that."""
    done: set[_Group] = set()
    taken: set[str] = set()
    for likeness, reason, group, other in found:
        if likeness < LEAST or group in done or other.names & taken:
            continue
        equals = any(
            same == likeness
            and g not in done
            and not o.names & taken
            and (g is group) != (o.names == other.names)
            for same, _, g, o in found
        )
        done.add(group)
        taken |= other.names
        if not equals:
            doubt = reason if likeness < CERTAIN else "" if other.certain else "which is 1, which 2"
            for number, variable in group.members.items():
                result[variable.name] = Match(other.members[number], doubt)
    return done, taken


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
        if unit is None or (other := theirs.unit(v)) is None or unit.measures(other)
    ]


def _likeness(group: _Group, other: _Group, alone: bool) -> tuple[float, str]:
    """How much a group of another FMU is like one of ours, from 0 to about 1, and by what.

    alone says that nothing else that is left fits either; it counts unless the name of the other
    means another quantity.
    """
    if group.words == other.words or _plural(group.words) == _plural(other.words):
        return 1.1, ""
    if group.meaning == other.meaning:
        return 1.0, ""
    units = group.unit is not None and other.unit is not None
    is_symbol = other.joined == group.symbol
    if is_symbol and units:
        return 0.95, ""
    common = group.meaning & other.meaning
    alone = alone and (units or group.first.kind != "Real")
    alone = alone and bool(common or not other.meaning & _SAME.keys())
    by_name = 0.8 if is_symbol else 0.7 * len(common) / len(group.meaning | other.meaning)
    told = [m for m, s in ((group.meaning, other.told), (other.meaning, group.told)) if m <= s]
    by_text = max((0.3 + 0.1 * len(meaning) for meaning in told), default=0.0)
    reasons = ["by its name", "by its description", "the only one of its unit and type"]
    values = [by_name, by_text, ALONE if alone else 0.0]
    return max(values[:2]) + values[2], reasons[values.index(max(values))]


def _groups(interface: Interface) -> list[_Group]:
    """The groups of all variables that can be connected, set or recorded, the largest first.

    A variable is in one group for each way to number it, and in one of its own.
    """
    variables = [
        v for v in interface.of("input", "output", "parameter") if v.supported and not v.alias
    ]
    several: dict[_Pattern, dict[int, tuple[Variable, bool]]] = {}
    for v in variables:
        for pattern, number, certain in _numbered(v):
            several.setdefault(pattern, {})[number] = (v, certain)
    found = [_Group(_words(v.name), {0: v}, True, interface) for v in variables]
    for pattern, members in several.items():
        least = min(members)
        if least <= 1 and [*range(least, least + max(2, len(members)))] == sorted(members):
            ordered = {n + 1 - least: members[n][0] for n in sorted(members)}
            certain = least == 1 and all(sure for _, sure in members.values())
            words = _words(members[least][0].name if pattern.by_text else pattern.rest)
            found.append(_Group(words, ordered, certain, interface, pattern.by_text))
    return sorted(found, key=lambda g: -len(g.members))


def _apart(groups: Iterable[_Group]) -> Iterator[_Group]:
    """Of groups, those that have nothing in common with an earlier one."""
    done: set[str] = set()
    for group in groups:
        if not group.names & done:
            done |= group.names
            yield group


class _Pattern(NamedTuple):
    """A name without a number in it, or a word for one, and what tells groups apart besides."""

    rest: str
    start: int
    words: tuple[str, ...]
    by_text: bool
    nature: tuple[str | None, ...]


def _numbered(variable: Variable) -> Iterator[tuple[_Pattern, int, bool]]:
    """The ways to read a name or description as a numbered one; the number, if it is for sure."""
    nature = variable.kind, variable.causality, variable.unit
    for name, sure in ((variable.name, True), (variable.description or "", False)):
        for match in _WORD.finditer(name):
            text, rest = match[0].lower(), f"{name[: match.start()]} {name[match.end() :]}"
            if sure and text.isdecimal() and len(text) < 6:
                yield _Pattern(rest, match.start(), (), False, nature), int(text), True
            for sides, certain in _SIDES:
                if text in sides:
                    pattern = _Pattern(rest, match.start(), sides, not sure, nature)
                    yield pattern, 1 + sides.index(text), certain
            if sure and len(text) > 1 and text[-1] in _GLUED:
                glued = f"{name[: match.end() - 1]} {name[match.end() :]}"
                pattern = _Pattern(glued, match.start(), _GLUED, False, nature)
                yield pattern, 1 + _GLUED.index(text[-1]), False


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
