"""The one reader of a model description: FMI 1.0, 2.0 and 3.0, from whichever tool.

What it reads is checked. A number that only a master needs may be wrong: that is a flaw, for which
read_interface() refuses the FMU, but describe() does not.
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from xml.etree.ElementTree import Element

from ..base.collector import without_collector
from ..base.errors import InputError
from ..base.files import check_fmu_file
from ..base.platforms import elf_processor
from ..base.si_units import Unit, known_unit
from .attributes import (
    base_unit,
    check_identifier,
    decimal_in,
    printable_name,
    real_in,
    references_in,
    whole_in,
)
from .fmi_types import FMI_1_AND_2_TYPES, FMI_3_TYPES, Value, kind_of, limits, typed
from .interface import Interface, ModelExchange
from .model_description import read_document, unreadable
from .obstacles import capabilities_of, kinds_of, of_binary, of_kind, platform_of
from .variables import PARAMETERS, SETTABLE, Clock, Enumeration, Variable

NUMERIC = ("Real", "Integer")
MAX_DEPENDENCIES = 5_000_000
"""In all: of 2,000 outputs on 2,000 inputs, and some."""
MAX_EVENT_INDICATORS = 1_000_000
EXPERIMENT = {
    "start_time": "startTime", "stop_time": "stopTime", "tolerance": "tolerance",
    "step_size": "stepSize",
}  # fmt: skip
INFINITE = {
    "2": "VendorAnnotations/Tool[@name='grasp-cosim']/Infinite",
    "3": "Annotations/Annotation[@type='grasp-cosim']/Infinite",
}
"""Where our FMUs name the inputs of which inf is a value, by version of FMI."""
BOUNDS = ("min", "max", "nominal")
Names = tuple[str, ...] | None
"""The variables that one depends on; None where that is not declared."""


def read_interface(path: Path) -> Interface:
    """The interface of the FMU at `path`, for a master; InputError where it cannot run it."""
    return _for_master(path, _identity(path))


@lru_cache(maxsize=64)
def _for_master(path: Path, identity: tuple[int, ...]) -> Interface:
    interface = _described(path, identity)
    if obstacle := of_kind(interface):
        raise InputError(f"{path}: {obstacle}")
    if interface.flaw:
        raise unreadable(path, interface.flaw)
    return replace(interface, path=path.resolve(), user_path=path)


def check_runs(path: Path) -> None:
    """InputError where the FMU at `path` is not for this master, or this machine."""
    interface = describe(path)
    obstacle = of_kind(interface) or of_binary(interface)
    if obstacle:
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
        first_kind = root if reader.major == "1" else next(iter(kinds.values()), root)
        identifier = first_kind.get("modelIdentifier", "")
        with reader.tolerated():
            check_identifier(identifier)
        exchange = reader.exchange(kinds)
        experiment = reader.experiment()
    except ValueError as error:
        raise unreadable(path, error) from error
    log_categories = [e.get("name", "") for e in root.iterfind("LogCategories/Category")]
    guid_attribute = "instantiationToken" if reader.major == "3" else "guid"
    return Interface(
        path=path,
        guid=root.get(guid_attribute, ""),
        identifier=identifier,
        variables=variables,
        version=version,
        units=units,
        kinds=tuple(kinds),
        capabilities=capabilities_of(kinds, reader.major),
        experiment=experiment,
        log_categories=tuple(log_categories),
        platforms=_platforms(files),
        sources=any(map(_SOURCE_FILE.match, files)),
        python="resources/slavemodule.txt" in files,
        model_name=root.get("modelName"),
        tool=root.get("generationTool"),
        flaw=reader.flaws[0] if reader.flaws else "",
        ambiguous=reader.ambiguous,
        exchange=exchange,
    )


_SOURCE_FILE = re.compile(r"sources/.*\.c(c|pp|xx)?$")
_BINARY = re.compile(r"binaries/([^/]+)/[^/]+\.(so|dll|dylib)")


def _platforms(files: Mapping[str, bytes]) -> tuple[str, ...]:
    """The platforms that an FMU has a binary for, by its files and the first bytes of each."""
    platforms = set()
    for name, head in files.items():
        if match := _BINARY.fullmatch(name):
            platforms.add(platform_of(match[1], elf_processor(head)))
    return tuple(sorted(platforms))


class _Reader:
    """Reads the variables and units of a description; flaws are what can be tolerated."""

    def __init__(self, root: Element, major: str) -> None:
        self.root, self.major = root, major
        self.flaws: list[str] = []
        self.ambiguous: tuple[str, ...] = ()
        parent = root.find("ModelVariables")
        if parent is None:
            raise ValueError("no ModelVariables")
        self.elements = [element for element in parent if element.get("name") is not None]
        for element in self.elements:
            printable_name("variable", _name(element))
        self.references = [
            whole_in(f"variable {_name(e)!r}: valueReference", e.get("valueReference"), 2**32 - 1)
            for e in self.elements
        ]
        self.type_elements = [self.with_type(e) for e in self.elements]
        self.check_references()
        keys = self.references if major == "3" else range(1, len(self.elements) + 1)
        self.places = dict(zip(keys, self.elements, strict=True))
        self.names = {str(key): _name(e) for key, e in self.places.items()}
        self.types = self.declared_types()
        self.enumerations = {name: self.enumeration(name, t) for name, t in self.types.items()}
        infinite = root.iterfind(INFINITE.get(major, INFINITE["2"]))
        self.infinite = frozenset(element.get("variable") for element in infinite)

    def declared_types(self) -> dict[str, Element]:
        """The elements of type definitions by name; before FMI 3.0 each is within another one."""
        types: dict[str, Element] = {}
        for element in self.root.iterfind("TypeDefinitions/*"):
            name = element.get("name")
            if name and self.major == "3":
                types[name] = element
            elif name and len(element):
                types[name] = element[0]
        return types

    def experiment(self) -> dict[str, Value | None]:
        """The default experiment; a step that is no number is a flaw."""
        element = self.root.find("DefaultExperiment")
        attributes = {} if element is None else element.attrib
        with self.tolerated():
            real_in("DefaultExperiment: stepSize", attributes.get("stepSize", "0"))
        return {key: typed("Real", attributes.get(name)) for key, name in EXPERIMENT.items()}

    def check_references(self) -> None:
        """ValueError where two variables of FMI 3.0 have the same: it says what depends on what.

        In FMI 2.0 such are two names of one, and a flaw where an input could be set by both.
        """
        if len(set(self.references)) == len(self.references):
            return
        earlier: dict[tuple[int, str], tuple[str, str | None]] = {}
        for element, type_element, reference in zip(
            self.elements, self.type_elements, self.references, strict=True
        ):
            name, causality = _name(element), element.get("causality")
            key = (reference, "")
            if self.major != "3":
                if causality not in SETTABLE:
                    continue
                key = (reference, "" if type_element is None else kind_of(type_element.tag))
            if key in earlier:
                earlier_name, earlier_causality = earlier[key]
                names = f"variables {earlier_name!r} and {name!r}"
                message = f"{names} have the valueReference {reference} both"
                if self.major == "3":
                    raise ValueError(f"{message}; must be unique")
                if "input" in (causality, earlier_causality):
                    self.flaws.append(f"{message}; one of them at most may be set")
            earlier[key] = (name, causality)

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
            label = printable_name(f"type {name!r}: item", item.get("name", ""))
            text = str(count) if self.major == "1" else item.get("value")
            with self.tolerated():
                items.append((label, whole_in(f"type {name!r}: item {label!r}", text)))
        return Enumeration(name, tuple(items))

    def units(self) -> dict[str, Unit]:
        """The units that are defined in terms of the SI base units.

        Some tools write every unit without a dimension: one that is known to have one, like mm, is
        then not defined.
        """
        units = {}
        for element in self.root.iterfind("UnitDefinitions/Unit"):
            name = printable_name("unit", element.get("name", ""))
            base = element.find("BaseUnit")
            if base is None:
                continue
            with self.tolerated():
                unit, unit_of_name = base_unit(name, base.attrib), known_unit(name)
                is_empty = unit.si and not any(unit.exponents)
                is_wrong = is_empty and unit_of_name and not unit_of_name.measures(unit)
                if not is_wrong:
                    units[name] = unit
        return units

    def variables(self) -> tuple[Variable, ...]:
        """The variables, then the aliases of FMI 3.0; not those of a name that several have."""
        dependencies, initial_dependencies = (
            self.unknowns("Output"),
            self.unknowns("InitialUnknown"),
        )
        inputs = tuple(_name(e) for e in self.elements if e.get("causality") == "input")
        for name, names in initial_dependencies.items():
            if names is None:
                initial_dependencies[name] = inputs
        parts = zip(
            self.elements, self.type_elements, self.references, self.names.values(), strict=True
        )
        variables = [
            self.variable(e, kind, key, dependencies.get(name), initial_dependencies.get(name))
            for e, kind, key, name in parts
        ]
        if self.major == "3":
            variables += list(self.aliases(variables))
        counts = Counter(variable.name for variable in variables)
        self.ambiguous = tuple(name for name, count in counts.items() if count > 1)
        if not self.ambiguous:
            return tuple(variables)
        return tuple(variable for variable in variables if counts[variable.name] == 1)

    def aliases(self, variables: Sequence[Variable]) -> Iterator[Variable]:
        """The other names of variables, which stand within their elements."""
        for v, element in zip(variables, self.elements, strict=True):
            for alias in element.iterfind("Alias") if len(element) else ():
                yield replace(
                    v,
                    name=printable_name("variable", _name(alias)),
                    description=alias.get("description") or v.description,
                    display_unit=alias.get("displayUnit") or v.display_unit,
                    alias=True,
                )

    def unknowns(self, group: str) -> dict[str, Names]:
        """By name of an unknown what it depends on; FMI 1.0 has that at its variables."""
        if self.major == "1":
            return self.direct_dependencies()
        key, path = "index", f"{group}s/Unknown"
        if self.major == "3":
            key, path = "valueReference", group

        def name_of(place: str, text: str | None) -> str:
            if text in self.names:
                return self.names[text]
            element = self.places.get(whole_in(place, text))
            if element is None:
                raise ValueError(f"{place} = {text!r}: must be the {key} of a variable")
            return _name(element)

        unknowns: dict[str, Names] = {}
        entries = self.root.findall(f"ModelStructure/{path}")
        total = sum(e.get("dependencies", "").count(" ") for e in entries)
        if total > MAX_DEPENDENCIES:
            raise ValueError(f"{path}: {total} dependencies; must have at most {MAX_DEPENDENCIES}")
        for entry in entries:
            name = name_of(f"{group}: {key}", entry.get(key))
            dependencies = entry.get("dependencies")
            if dependencies is None:
                unknowns[name] = None
                continue
            keys = dependencies.split()
            try:
                unknowns[name] = tuple(map(self.names.__getitem__, keys))
            except KeyError:  # a number that is written otherwise, like 01, or is wrong
                place = f"{group} {name!r}: dependencies"
                unknowns[name] = tuple(name_of(place, text) for text in keys)
        return unknowns

    def direct_dependencies(self) -> dict[str, Names]:
        """What the variables of FMI 1.0 depend on, those for which that is declared."""
        dependencies: dict[str, Names] = {}
        for element in self.elements:
            direct = element.find("DirectDependency")
            if direct is not None:
                names = [child.text for child in direct.iter("Name") if child.text]
                dependencies[_name(element)] = tuple(names)
        return dependencies

    def variable(
        self,
        element: Element,
        type_element: Element | None,
        reference: int,
        dependencies: Names,
        initial_dependencies: Names,
    ) -> Variable:
        """One variable, whose type `type_element` says."""
        name = _name(element)
        place = f"variable {name!r}"
        if type_element is None:
            types = FMI_3_TYPES if self.major == "3" else FMI_1_AND_2_TYPES
            raise ValueError(f"{place}: has no type; must be one of {', '.join(types)}")
        kind, attributes = kind_of(type_element.tag), type_element.attrib
        type_name = attributes.get("declaredType", "")
        declared_type = self.types.get(type_name)
        if declared_type is not None:
            own_attributes = {key: text for key, text in attributes.items() if text}
            attributes = {**declared_type.attrib, **own_attributes}
        low = high = nominal = None
        if kind in NUMERIC and not attributes.keys().isdisjoint(BOUNDS):
            low, high, nominal = self.bounds(place, type_element.tag, attributes)
        causality, variability = self.nature(element, kind)
        start = type_element.get("start")
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
            self.check_starts(f"{place}: start", type_element.tag, texts)
        enumeration = (
            self.enumerations.get(type_name) if type_element.tag == "Enumeration" else None
        )
        clock = self.clock(place, attributes) if kind == "Clock" else None
        clocks = references_in(place, attributes["clocks"]) if "clocks" in attributes else ()
        return Variable(
            name,
            kind,
            causality,
            reference,
            attributes.get("unit") or None,
            start,
            low,
            high,
            type_element.tag,
            variability=variability,
            dependencies=dependencies,
            initial_dependencies=initial_dependencies,
            shape=shape,
            sizes=sizes,
            description=element.get("description"),
            magnitude=nominal,
            relative=attributes.get("relativeQuantity") in ("true", "1"),
            enumeration=enumeration,
            initial=self.initial(element, causality, variability),
            display_unit=attributes.get("displayUnit") or None,
            starts=starts,
            infinite=name in self.infinite,
            clock=clock,
            clocks=clocks,
        )

    def clock(self, place: str, attributes: Mapping[str, str]) -> Clock:
        """When a clock ticks, by its attributes and those of its type."""
        interval, shift, resolution = None, Fraction(0), 0
        with self.tolerated():
            if "resolution" in attributes:
                resolution = whole_in(f"{place}: resolution", attributes["resolution"])
            if resolution and "intervalCounter" in attributes:
                counter = whole_in(f"{place}: intervalCounter", attributes["intervalCounter"])
                interval = Fraction(counter, resolution)
            elif "intervalDecimal" in attributes:
                interval = decimal_in(f"{place}: intervalDecimal", attributes["intervalDecimal"])
            if resolution and "shiftCounter" in attributes:
                shift = Fraction(
                    whole_in(f"{place}: shiftCounter", attributes["shiftCounter"]), resolution
                )
            elif "shiftDecimal" in attributes:
                shift = decimal_in(f"{place}: shiftDecimal", attributes["shiftDecimal"])
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
                    real_in(f"{place}: {key}", value)
        return values

    def initial(self, element: Element, causality: str, variability: str) -> str | None:
        """How the value at the start comes about. The tables of the standard decide if it is not
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
            real_in(place, text)
            return
        low, high = limits(fmi_type, self.major)
        if not low <= whole_in(place, text) <= high:
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
            check_identifier(identifier)
            key = "numberOfEventIndicators"
            indicators = whole_in(key, self.root.get(key, "0"), MAX_EVENT_INDICATORS)
        states = len(self.root.findall("ModelStructure/Derivatives/Unknown"))
        if self.major == "3":
            is_needed = element.get("needsCompletedIntegratorStep") in ("true", "1")
        else:
            is_needed = element.get("completedIntegratorStepNotNeeded") not in ("true", "1")
        return ModelExchange(identifier, states, indicators, is_needed)

    def dimension(self, place: str, element: Element) -> tuple[int, str | None]:
        """The size in a dimension of an array, and the variable that holds it; None if fixed."""
        place = f"{place}: Dimension"
        text, name = element.get("start"), None
        if text is None:
            key = whole_in(f"{place}: valueReference", element.get("valueReference"))
            holder = self.places.get(key)
            if holder is not None:
                text, name = holder.get("start"), _name(holder)
        return whole_in(place, text, 2**64 - 1), name


def _name(element: Element) -> str:
    return element.get("name", "")
