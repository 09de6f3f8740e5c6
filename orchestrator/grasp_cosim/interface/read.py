"""The one reader of a model description: FMI 1.0, 2.0 and 3.0, from whichever tool.

What it reads is checked. A number that only a master needs may be wrong: that is a flaw, for which
read_interface() refuses the FMU, but describe() does not.
"""

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from xml.etree.ElementTree import Element

from ..base.checks import integer, real
from ..base.collector import without_collector
from ..base.errors import InputError
from ..base.files import check_fmu_file
from ..base.si_units import BASE, Unit, known_unit
from .fmi_types import FMI_1_AND_2_TYPES, FMI_3_TYPES, Value, kind_of, limits, typed
from .interface import Interface, ModelExchange
from .model_description import read_document, unreadable
from .obstacles import capabilities_of, kinds_of, of_binary, of_kind, platform_of
from .variables import PARAMETERS, SETTABLE, Clock, Enumeration, Variable

NUMERIC = ("Real", "Integer")
CONTROL = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029]")
"""Characters that end a line of a message or table, or move the cursor of a terminal."""
LONGEST_NAME = 2000
"""Characters; those of the largest FMUs have some hundreds."""
MOST_DEPENDENCIES = 5_000_000
"""In all: of 2,000 outputs on 2,000 inputs, and some."""
MOST_INDICATORS = 1_000_000
"""Event indicators of an FMU."""
EXPERIMENT = {
    "start_time": "startTime", "stop_time": "stopTime", "tolerance": "tolerance",
    "step_size": "stepSize",
}  # fmt: skip
INFINITE = {
    "2": "VendorAnnotations/Tool[@name='grasp-cosim']/Infinite",
    "3": "Annotations/Annotation[@type='grasp-cosim']/Infinite",
}
"""Where FMUs of ours name the inputs of which inf is a value, by version of FMI."""
BOUNDS = ("min", "max", "nominal")
Names = tuple[str, ...] | None
"""The variables that one depends on; None where that is not declared."""


def read_interface(path: Path) -> Interface:
    """The interface of the FMU at `path`, for a master; InputError where it cannot run it."""
    return _for_master(path, _identity(path))


@lru_cache(maxsize=64)
def _for_master(path: Path, identity: tuple[int, ...]) -> Interface:
    found = _described(path, identity)
    if obstacle := of_kind(found):
        raise InputError(f"{path}: {obstacle}")
    if found.flaw:
        raise unreadable(path, found.flaw)
    return replace(found, path=path.resolve(), user_path=path)


def check_runs(path: Path) -> None:
    """InputError where the FMU at `path` is not for this master, or this machine."""
    found = describe(path)
    if obstacle := of_kind(found) or of_binary(found):
        raise InputError(f"{path}: {obstacle}")


def describe(path: Path) -> Interface:
    """Return the interface that the FMU at `path` declares, whether a master takes it or not.

    InputError where there is no FMU, or what it declares makes no sense.
    """
    return _described(path, _identity(path))


def _identity(path: Path) -> tuple[int, ...]:
    """What tells the file at `path` from one that was there before; InputError if it is no FMU."""
    if not path.is_file():  # which is asked some hundred times a run
        check_fmu_file(path)
    file = path.stat()
    return file.st_dev, file.st_ino, file.st_mtime_ns


@lru_cache(maxsize=64)
def _described(path: Path, identity: tuple[int, ...]) -> Interface:
    with without_collector():
        return _read(path)


def _read(path: Path) -> Interface:
    root, files = read_document(path)
    version = root.get("fmiVersion", "")
    try:
        if version not in ("1.0", "2.0") and not version.startswith("3."):
            raise ValueError(f"Unsupported FMI version: {version}")
        reader = _Reader(root, version[0])
        variables, units = reader.variables(), reader.units()
        kinds = kinds_of(root, reader.major)
        identified = root if reader.major == "1" else next(iter(kinds.values()), root)
        identifier = identified.get("modelIdentifier", "")
        with reader.tolerated():
            _check_identifier(identifier)
        exchange = reader.exchange(kinds)
        experiment = {} if (e := root.find("DefaultExperiment")) is None else e.attrib
        with reader.tolerated():
            _real("DefaultExperiment: stepSize", experiment.get("stepSize", "0"))
    except ValueError as error:
        raise unreadable(path, error) from error
    return Interface(
        path=path,
        guid=root.get("instantiationToken" if reader.major == "3" else "guid", ""),
        identifier=identifier,
        variables=variables,
        version=version,
        units=units,
        kinds=tuple(kinds),
        capabilities=capabilities_of(kinds, reader.major),
        experiment={key: typed("Real", experiment.get(name)) for key, name in EXPERIMENT.items()},
        log_categories=tuple(e.get("name", "") for e in root.iterfind("LogCategories/Category")),
        platforms=_platforms(files),
        sources=any(re.match(r"sources/.*\.c(c|pp|xx)?$", name) for name in files),
        python="resources/slavemodule.txt" in files,
        model_name=root.get("modelName"),
        tool=root.get("generationTool"),
        flaw=reader.flaws[0] if reader.flaws else "",
        ambiguous=reader.ambiguous,
        exchange=exchange,
    )


def _platforms(files: Mapping[str, bytes]) -> tuple[str, ...]:
    parts = {name: name.split("/") for name in files if name.endswith((".so", ".dll", ".dylib"))}
    inside = {n: p[1] for n, p in parts.items() if p[0] == "binaries" and len(p) == 3}
    return tuple(sorted({platform_of(folder, files[name]) for name, folder in inside.items()}))


class _Reader:
    """Reads the variables and units of a description; flaws are what can be tolerated."""

    def __init__(self, root: Element, major: str) -> None:
        self.root, self.major = root, major
        self.flaws: list[str] = []
        self.ambiguous: tuple[str, ...] = ()
        parent = root.find("ModelVariables")
        if parent is None:
            raise ValueError("no ModelVariables")
        self.elements = [e for e in parent if e.get("name") is not None]
        for element in self.elements:
            _printable("variable", _name(element))
        self.references = [
            _whole(f"variable {_name(e)!r}: valueReference", e.get("valueReference"), 2**32 - 1)
            for e in self.elements
        ]
        self.typed = [self.with_type(e) for e in self.elements]
        self.check_references()
        keys = self.references if major == "3" else range(1, len(self.elements) + 1)
        self.places = dict(zip(keys, self.elements, strict=True))
        self.names = {str(key): _name(e) for key, e in self.places.items()}
        types = {n: t for t in root.iterfind("TypeDefinitions/*") if (n := t.get("name"))}
        self.types = types if major == "3" else {n: t[0] for n, t in types.items() if len(t)}
        self.enumerations = {name: self.enumeration(name, t) for name, t in self.types.items()}
        place = INFINITE.get(major, INFINITE["2"])
        self.infinite = frozenset(e.get("variable") for e in root.iterfind(place))

    def check_references(self) -> None:
        """ValueError where two variables of FMI 3.0 have the same: it says what depends on what.

        In FMI 2.0 such are two names of one, and a flaw where an input could be set by both.
        """
        if len(set(self.references)) == len(self.references):
            return
        seen: dict[tuple[int, str], tuple[str, str | None]] = {}
        for element, value, reference in zip(
            self.elements, self.typed, self.references, strict=True
        ):
            key, name, causality = (reference, ""), _name(element), element.get("causality")
            if self.major != "3":
                if causality not in SETTABLE:
                    continue
                key = (reference, "" if value is None else kind_of(value.tag))
            if key in seen:
                other, its = seen[key]
                text = f"{other!r} and {name!r} have the valueReference {reference} both"
                if self.major == "3":
                    raise ValueError(f"variables {text}; must be unique")
                if "input" in (causality, its):
                    self.flaws.append(f"variables {text}; one of them at most may be set")
            seen[key] = (name, causality)

    def with_type(self, element: Element) -> Element | None:
        """The element that says the type of a variable: in FMI 3.0 its own, else one within it."""
        if self.major == "3":
            return element if element.tag in FMI_3_TYPES else None
        for inner in element:
            if inner.tag in FMI_1_AND_2_TYPES:
                return inner
        return None

    @contextmanager
    def tolerated(self) -> Iterator[None]:
        """What is wrong with a number becomes a flaw."""
        try:
            yield
        except ValueError as error:
            self.flaws.append(str(error))

    def enumeration(self, name: str, declared: Element) -> Enumeration:
        """A declared type as an enumeration; the items of FMI 1.0 are counted."""
        items = []
        for count, item in enumerate(declared.iterfind("Item"), 1):
            label = _printable(f"type {name!r}: item", item.get("name", ""))
            text = str(count) if self.major == "1" else item.get("value")
            with self.tolerated():
                items.append((label, _whole(f"type {name!r}: item {label!r}", text)))
        return Enumeration(name, tuple(items))

    def units(self) -> dict[str, Unit]:
        """The units that are defined in terms of the SI base units.

        Some tools write every unit without a dimension: one that is known to have one, like mm, is
        then not defined.
        """
        found = {}
        for element in self.root.iterfind("UnitDefinitions/Unit"):
            name, base = _printable("unit", element.get("name", "")), element.find("BaseUnit")
            if base is not None:
                with self.tolerated():
                    unit, known = base_unit(name, base.attrib), known_unit(name)
                    empty = unit.si and not any(unit.exponents)
                    if not (empty and known and not known.measures(unit)):
                        found[name] = unit
        return found

    def variables(self) -> tuple[Variable, ...]:
        """The variables, then the aliases of FMI 3.0; not those of a name that several have."""
        now, initially = self.unknowns("Output"), self.unknowns("InitialUnknown")
        inputs = tuple(_name(e) for e in self.elements if e.get("causality") == "input")
        initially = {name: inputs if n is None else n for name, n in initially.items()}
        parts = zip(self.elements, self.typed, self.references, strict=True)
        variables = [
            self.variable(e, value, reference, now.get(name), initially.get(name))
            for (e, value, reference), name in zip(parts, self.names.values(), strict=True)
        ]
        if self.major == "3":
            variables += list(self.aliases(variables))
        names = Counter(v.name for v in variables)
        self.ambiguous = tuple(name for name, count in names.items() if count > 1)
        if not self.ambiguous:
            return tuple(variables)
        return tuple(v for v in variables if names[v.name] == 1)

    def aliases(self, variables: Sequence[Variable]) -> Iterator[Variable]:
        """The other names of variables, which stand within their elements."""
        for v, element in zip(variables, self.elements, strict=True):
            for alias in element.iterfind("Alias") if len(element) else ():
                yield replace(
                    v,
                    name=_printable("variable", _name(alias)),
                    description=alias.get("description") or v.description,
                    display_unit=alias.get("displayUnit") or v.display_unit,
                    alias=True,
                )

    def unknowns(self, group: str) -> dict[str, Names]:
        """By name of an unknown what it depends on; FMI 1.0 has that at its variables."""
        if self.major == "1":
            direct = {_name(e): e.find("DirectDependency") for e in self.elements}
            return {
                name: tuple(child.text for child in e.iter("Name") if child.text)
                for name, e in direct.items()
                if e is not None
            }
        key, way = "index", f"{group}s/Unknown"
        if self.major == "3":
            key, way = "valueReference", group

        def called(place: str, text: str | None) -> str:
            if text in self.names:
                return self.names[text]
            element = self.places.get(_whole(place, text))
            if element is None:
                raise ValueError(f"{place} = {text!r}: must be the {key} of a variable")
            return _name(element)

        found: dict[str, Names] = {}
        entries = self.root.findall(f"ModelStructure/{way}")
        total = sum(e.get("dependencies", "").count(" ") for e in entries)
        if total > MOST_DEPENDENCIES:
            raise ValueError(f"{way}: {total} dependencies; must have at most {MOST_DEPENDENCIES}")
        place = f"{group}: {key}"
        for element in entries:
            name, listed = called(place, element.get(key)), element.get("dependencies")
            if listed is None:
                found[name] = None
                continue
            parts = listed.split()
            try:
                found[name] = tuple(map(self.names.__getitem__, parts))
            except KeyError:  # which is written otherwise, or is wrong
                within = f"{group} {name!r}: dependencies"
                found[name] = tuple(called(within, part) for part in parts)
        return found

    def variable(
        self,
        element: Element,
        value: Element | None,
        reference: int,
        now: Names,
        initially: Names,
    ) -> Variable:
        """One variable, whose type is in value; it depends on others now and in initialisation."""
        name = _name(element)
        place = f"variable {name!r}"
        if value is None:
            types = FMI_3_TYPES if self.major == "3" else FMI_1_AND_2_TYPES
            raise ValueError(f"{place}: has no type; must be one of {', '.join(types)}")
        kind, attributes = kind_of(value.tag), value.attrib
        type_name = attributes.get("declaredType", "")
        declared = self.types.get(type_name)
        if declared is not None:
            stated = {key: text for key, text in attributes.items() if text}
            attributes = {**declared.attrib, **stated}
        low = high = nominal = None
        if kind in NUMERIC and not attributes.keys().isdisjoint(BOUNDS):
            low, high, nominal = self.bounds(place, value.tag, attributes)
        causality, variability = self.nature(element, kind)
        start = value.get("start")
        starts: tuple[str, ...] = ()
        shape: tuple[int, ...] = ()
        sizes: tuple[str | None, ...] = ()
        if self.major == "3" and len(element):
            starts = tuple(e.get("value", "") for e in element.iterfind("Start"))
            dimensions = [self.dimension(place, e) for e in element.iterfind("Dimension")]
            shape = tuple(size for size, _ in dimensions)
            sizes = tuple(holder for _, holder in dimensions)
        if self.major == "3" and kind in ("String", "Binary"):
            start = starts[0] if starts else None
        if kind in NUMERIC and start is not None:
            texts = start.split() if shape else (start,)
            self.check_starts(f"{place}: start", value.tag, texts)
        return Variable(
            name,
            kind,
            causality,
            reference,
            attributes.get("unit") or None,
            start,
            low,
            high,
            value.tag,
            variability=variability,
            dependencies=now,
            initial_dependencies=initially,
            shape=shape,
            sizes=sizes,
            description=element.get("description"),
            magnitude=nominal,
            relative=attributes.get("relativeQuantity") in ("true", "1"),
            enumeration=self.enumerations.get(type_name) if value.tag == "Enumeration" else None,
            initial=self.initial(element, causality, variability),
            display_unit=attributes.get("displayUnit") or None,
            starts=starts,
            infinite=name in self.infinite,
            clock=self.clock(place, attributes) if kind == "Clock" else None,
            clocks=_references(place, attributes["clocks"]) if "clocks" in attributes else (),
        )

    def clock(self, place: str, attributes: Mapping[str, str]) -> Clock:
        """When a clock ticks, by its attributes and those of its type."""
        interval, shift, resolution = None, Fraction(0), 0
        with self.tolerated():
            if "resolution" in attributes:
                resolution = _whole(f"{place}: resolution", attributes["resolution"])
            if resolution and "intervalCounter" in attributes:
                counter = _whole(f"{place}: intervalCounter", attributes["intervalCounter"])
                interval = Fraction(counter, resolution)
            elif "intervalDecimal" in attributes:
                interval = _decimal(f"{place}: intervalDecimal", attributes["intervalDecimal"])
            if resolution and "shiftCounter" in attributes:
                shift = Fraction(
                    _whole(f"{place}: shiftCounter", attributes["shiftCounter"]), resolution
                )
            elif "shiftDecimal" in attributes:
                shift = _decimal(f"{place}: shiftDecimal", attributes["shiftDecimal"])
            if interval is not None and interval <= 0:
                raise ValueError(f"{place}: interval = {float(interval):g} s: must be above 0")
            if shift < 0:
                raise ValueError(f"{place}: shift = {float(shift):g} s: must be at least 0")
        fractions = attributes.get("supportsFraction") in ("true", "1")
        return Clock(attributes.get("intervalVariability", ""), interval, shift, fractions)

    def bounds(
        self, place: str, fmi_type: str, attributes: Mapping[str, str]
    ) -> list[Value | None]:
        """Smallest, largest and nominal value of a variable; what is no number is a flaw."""
        values = [typed(fmi_type, attributes.get(key) or None) for key in BOUNDS]
        for key, value in zip(BOUNDS, values, strict=True):
            if isinstance(value, str):
                with self.tolerated():
                    _real(f"{place}: {key}", value)
        return values

    def initial(self, element: Element, causality: str, variability: str) -> str | None:
        """How the value at the start comes about, by the tables of the standard where it is not
        declared (2.2.7 of FMI 2.0, 2.4.7.5 of FMI 3.0); None where these have none.
        """
        declared = element.get("initial")
        if declared or self.major == "1" or causality == "independent":
            return declared
        return "exact" if causality in SETTABLE or variability == "constant" else "calculated"

    def check_starts(self, place: str, fmi_type: str, texts: Iterable[str]) -> None:
        """Have a start value that is no number of its type be a flaw."""
        try:
            for text in texts:
                self.check_start(place, fmi_type, text)
        except ValueError as error:
            self.flaws.append(str(error))

    def check_start(self, place: str, fmi_type: str, text: str) -> None:
        """ValueError where a start value is no number of its type."""
        if kind_of(fmi_type) == "Real":
            _real(place, text)
            return
        low, high = limits(fmi_type, self.major)
        if not low <= _whole(place, text) <= high:
            raise ValueError(f"{place} = {text}: must be from {low} to {high}, as {fmi_type} is")

    def nature(self, element: Element, kind: str) -> tuple[str, str]:
        """Causality and variability; the latter depends on the type where it is not declared."""
        causality = element.get("causality") or "local"
        variability = element.get("variability")
        if self.major == "1":
            causality = "local" if causality == "internal" else causality
            if variability == "parameter":
                return "parameter", "fixed"
        if variability or self.major != "3":
            return causality, variability or "continuous"
        if causality in (*PARAMETERS, "calculatedParameter"):
            return causality, "fixed"
        return causality, "continuous" if kind == "Real" else "discrete"

    def exchange(self, kinds: Mapping[str, Element]) -> ModelExchange | None:
        """The needs of model exchange; None where the FMU is not for that."""
        if "ModelExchange" not in kinds:
            return None
        element, indicators = kinds["ModelExchange"], 0
        identifier = element.get("modelIdentifier", "")
        with self.tolerated():
            _check_identifier(identifier)
            key = "numberOfEventIndicators"
            indicators = _whole(key, self.root.get(key, "0"), MOST_INDICATORS)
        states = len(self.root.findall("ModelStructure/Derivatives/Unknown"))
        if self.major == "3":
            told = element.get("needsCompletedIntegratorStep") in ("true", "1")
        else:
            told = element.get("completedIntegratorStepNotNeeded") not in ("true", "1")
        return ModelExchange(identifier, states, indicators, told)

    def dimension(self, place: str, element: Element) -> tuple[int, str | None]:
        """The size in a dimension of an array, and the variable that holds it; None if fixed."""
        text, name, place = element.get("start"), None, f"{place}: Dimension"
        if text is None:
            key = _whole(f"{place}: valueReference", element.get("valueReference"))
            holder = self.places.get(key)
            text, name = (None, None) if holder is None else (holder.get("start"), _name(holder))
        return _whole(place, text, 2**64 - 1), name


def base_unit(name: str, base: Mapping[str, str]) -> Unit:
    """The unit of the attributes of a BaseUnit of FMI or SSP; ValueError where it is none."""
    place = f"unit {name!r}"
    exponents = tuple(_whole(f"{place}: {key}", base.get(key, "0")) for key in BASE)
    factor = _real(f"{place}: factor", base.get("factor", "1"))
    offset = _real(f"{place}: offset", base.get("offset", "0"))
    if not factor or not math.isfinite(factor) or not math.isfinite(offset):
        said = f"{place}: factor = {factor:g}, offset = {offset:g}"
        raise ValueError(f"{said}: must be finite, and the factor other than 0")
    return Unit(name, exponents, factor, offset)


def _check_identifier(identifier: str) -> None:
    """ValueError where it could not be the name of a file in a folder of the FMU."""
    if not identifier or CONTROL.search(identifier) or re.search(r"[/\\:]|^\.", identifier):
        raise ValueError(f"modelIdentifier = {identifier!r}: must be the name of its binary")


def _name(element: Element) -> str:
    return element.get("name", "")


def _printable(what: str, name: str) -> str:
    """The name; ValueError where it is very long or holds a control character."""
    if len(name) > LONGEST_NAME:
        raise ValueError(
            f"{what} {name[:40]!r}...: {len(name)} characters; must have at most {LONGEST_NAME}"
        )
    if CONTROL.search(name):
        raise ValueError(f"{what} {name!r}: must have no control characters")
    return name


def _real(place: str, text: str) -> float:
    try:
        return real(text)
    except ValueError:
        raise ValueError(f"{place} = {text!r}: must be a number") from None


def _references(place: str, clocks: str) -> tuple[int, ...]:
    """The value references of the clocks that a variable is of."""
    return tuple(_whole(f"{place}: clocks", text) for text in clocks.split())


def _decimal(place: str, text: str) -> Fraction:
    """The number that a text is, exactly."""
    _real(place, text)
    try:
        return Fraction(text.strip())
    except ValueError:
        raise ValueError(f"{place} = {text!r}: must be a finite number") from None


def _whole(place: str, text: str | None, high: int | None = None) -> int:
    """The whole number in a text, from 0 to high where that is given."""
    if text is not None:
        try:
            number = integer(text)
        except ValueError:
            pass
        else:
            if high is None or 0 <= number <= high:
                return number
    must = "a whole number" + ("" if high is None else f" from 0 to {high}")
    found = "missing" if text is None else repr(text)
    raise ValueError(f"{place} = {found}: must be {must}")
