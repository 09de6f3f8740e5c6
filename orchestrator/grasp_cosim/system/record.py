"""What a run records: the outputs, or the signals that [record] of a system file names.

A pattern is a name like plant.gap[1], in which * stands for any text and ? for one character; all
else is meant as it stands, brackets too. The name of an array stands for its elements. A pattern
behind a ! leaves out what it matches. Without one that takes signals in, each component has what it
has by default: its outputs, or its locals where it has no output, and the inputs that are acted on.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from ..base.errors import InputError, choices, nearest
from ..interface.fmi_types import SUPPORTED_KINDS
from ..interface.interface import Interface
from ..interface.variables import Variable
from .parts import Component, Condition, Port
from .times import Time

LEFT_OUT = "!"
"""Begins a pattern that leaves out what it matches."""

ENERGY = "exchange_energy"
"""In the place of `force` in the name of an input, what is worked out of it: exchange/energy.py."""

_WILD = {"*": ".*", "?": "."}


@dataclass(frozen=True, slots=True)
class Pattern:
    """One entry of [record]: the names that it matches, and whether it leaves them out."""

    text: str
    regex: re.Pattern[str]
    leaves_out: bool

    @property
    def is_name(self) -> bool:
        """True if it is one name, without * or ?."""
        return not any(letter in self.text for letter in _WILD)

    def matches(self, names: Sequence[str]) -> bool:
        """True if it is one of the names of a signal, or stands for it."""
        return any(self.regex.fullmatch(name) for name in names)

    def takes(self, component: Component, variable: Variable) -> bool:
        """True if it matches a variable; the time of an FMU only by its name."""
        if variable.causality == "independent" and not self.is_name:
            return False
        return self.matches(_names(component, variable))


def pattern(text: str) -> Pattern:
    """The pattern of an entry."""
    plain = text.removeprefix(LEFT_OUT)
    regex = "".join(_WILD.get(letter, re.escape(letter)) for letter in plain)
    return Pattern(plain, re.compile(regex, re.DOTALL), plain != text)


@dataclass(frozen=True, slots=True)
class Trigger:
    """When a run is recorded: in windows around the points at which a condition becomes true.

    A window has what came in before_ns before such a point, and goes on until after_ns after the
    last one in it.
    """

    when: Condition
    before_ns: Time
    after_ns: Time


@dataclass(frozen=True)
class Record:
    """What a system records: patterns as they stand in its file, and when: always by default."""

    signals: tuple[str, ...] = ()
    trigger: Trigger | None = None

    @property
    def takes_in(self) -> bool:
        """True if it names what is recorded, in the place of what is recorded by default."""
        return bool(self._patterns()[0])

    def chosen(
        self, components: Sequence[Component], acted_on: Collection[Port] = ()
    ) -> dict[Port, Variable]:
        """The signals that are recorded, in the order of the system; no arrays, no binaries.

        acted_on are the inputs that are recorded by default.
        """
        taken_in, left_out = self._patterns()
        chosen: dict[Port, Variable] = {}
        for component in components:
            supported = [v for v in component.interface.variables if v.supported]
            if taken_in:
                variables = _matching(component, supported, taken_in)
            else:
                names = {v.name for v in by_default(component.interface)}
                names |= {p.variable for p in acted_on if p.component == component.name}
                variables = [v for v in supported if v.name in names]
            unwanted = {v.name for v in _matching(component, variables, left_out)}
            for v in variables:
                if v.name not in unwanted:
                    chosen[Port(component.name, v.name)] = v
        return chosen

    def watched(self, components: Sequence[Component]) -> dict[Port, Variable]:
        """The outputs but those that are left out, whether they are recorded or not."""
        _, left_out = self._patterns()
        watched: dict[Port, Variable] = {}
        for component in components:
            outputs = [v for v in component.interface.of("output") if v.supported]
            unwanted = {v.name for v in _matching(component, outputs, left_out)}
            for v in outputs:
                if v.name not in unwanted:
                    watched[Port(component.name, v.name)] = v
        return watched

    def with_texts(self, texts: Iterable[str]) -> Record:
        """The record with the signals of texts as on a command line, each a list with commas.

        A comma in brackets is part of a name: a.A[1,2].
        """
        entries: list[str] = []
        for text in texts:
            depth, entry = 0, ""
            for letter in text:
                if letter in "[(":
                    depth += 1
                elif letter in "])":
                    depth -= 1
                if letter == "," and depth <= 0:
                    entries.append(entry.strip())
                    entry = ""
                else:
                    entry += letter
            entries.append(entry.strip())
        return replace(self, signals=tuple(entries))

    def has(self, name: str) -> bool:
        """True if a signal is recorded that is worked out of others."""
        taken_in, left_out = self._patterns()
        is_taken_in = not taken_in or any(p.matches([name]) for p in taken_in)
        return is_taken_in and not any(p.matches([name]) for p in left_out)

    def with_outputs(self, components: Sequence[Component]) -> Record:
        """The record that has all outputs in addition, but for those that are left out."""
        outputs = [str(port) for port in self.watched(components)] if self.takes_in else []
        return replace(self, signals=(*self.signals, *outputs))

    def untriggered(self) -> Record:
        """The record of the whole run."""
        return replace(self, trigger=None)

    def check(
        self, place: str, components: Sequence[Component], outputs: Collection[str] = ()
    ) -> None:
        """InputError at the first pattern that matches no signal, or none that can be recorded.

        outputs are the names of those of the system itself.
        """
        for text in self.signals:
            if reason := missing(text, components, outputs):
                raise InputError(f"{place} {text!r} {reason}")

    def without_missing(
        self, old: Sequence[Component], new: Sequence[Component], outputs: Collection[str] = ()
    ) -> tuple[Record, list[str]]:
        """The record of a system with other FMUs, and its entries that match nothing any more."""
        unmatched = [
            text
            for text in self.signals
            if missing(text, new, outputs) and not missing(text, old, outputs)
        ]
        matched = tuple(text for text in self.signals if text not in unmatched)
        return replace(self, signals=matched), unmatched

    def _patterns(self) -> tuple[list[Pattern], list[Pattern]]:
        """Those that take signals in, and those that leave them out."""
        patterns = [pattern(text) for text in self.signals]
        taken_in = [p for p in patterns if not p.leaves_out]
        return taken_in, [p for p in patterns if p.leaves_out]


def by_default(interface: Interface) -> list[Variable]:
    """The outputs of a component; of one that has none, its locals."""
    outputs = [v for v in interface.of("output") if v.supported]
    return outputs or [v for v in interface.of("local") if v.supported]


def missing(
    text: str, components: Sequence[Component], outputs: Collection[str] = ()
) -> str | None:
    """Why a pattern records nothing, or leaves nothing out; None where it does."""
    signal = pattern(text)
    unrecordable: tuple[Component, Variable] | None = None
    for component in components:
        for v in component.interface.variables:
            if signal.takes(component, v):
                if v.supported:
                    return None
                unrecordable = unrecordable or (component, v)
    if unrecordable:
        component, v = unrecordable
        return (
            f"is of type {v.nature}: {component.name}.{v.name} cannot be recorded; must be "
            f"{choices(SUPPORTED_KINDS)}"
        )
    if any(signal.matches([name]) for name in (*outputs, *_worked_out(components))):
        return None
    names = [f"{c.name}.{v.name}" for c in components for v in c.interface.variables if v.supported]
    wholes = [f"{c.name}.*" for c in components]
    see = components[0].interface.listing if len(components) == 1 else _LISTINGS
    return f"matches no signal; {nearest(signal.text, [*outputs, *wholes, *names], see)}"


_LISTINGS = "`grasp-cosim inspect FMU`"


def _matching(
    component: Component, variables: Sequence[Variable], patterns: Sequence[Pattern]
) -> list[Variable]:
    """The variables of a component that match any of the patterns."""
    return [v for v in variables if any(p.takes(component, v) for p in patterns)]


def _names(component: Component, variable: Variable) -> list[str]:
    """The name of a signal and, of an element of an array, that of the array."""
    names = [f"{component.name}.{variable.name}"]
    if variable.element:
        names.append(f"{component.name}.{variable.element.array}")
    return names


def _worked_out(components: Sequence[Component]) -> Iterator[str]:
    """The names that signals may have which are worked out of others."""
    for component in components:
        for v in component.interface.of("input"):
            if v.name.startswith("force"):
                yield f"{component.name}.{v.name.replace('force', ENERGY)}"
