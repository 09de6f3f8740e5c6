"""A study from a TOML file, in the format that orchestrator/README.md describes."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from ..checks import as_table, check_keys, number, text, toml_table, whole
from ..errors import InputError, choices
from ..interface.interface import Value
from ..metrics.metric import Metric, load_metrics
from ..system.description import System
from .design import Design
from .distributions import Distribution, Listed, Normal, Uniform, spaced
from .study import Map, Parameter, Pictures, Study

KEYS = {
    "system", "presets", "bench", "case", "metrics", "step", "stop", "seeds", "outputs", "swap",
    "values", "design", "parameters", "figures",
}  # fmt: skip

Made = TypeVar("Made")
Load = Callable[[Path | None], System]
"""Reads a system; None stands for the built-in one."""

Preset = Callable[[System, str], System]
"""Applies a preset of that name to a system."""

MOST_LEVELS = 100_000
"""Values of one parameter at most."""


def study_file(name: str, folder: Path) -> Path:
    """The file of a study, given by its path or by the name of one in the folder of studies."""
    path, known = Path(name), sorted(p.stem for p in folder.glob("*.toml"))
    if path.suffix != ".toml" and name in known:
        return folder / f"{name}.toml"
    if not path.is_file():
        raise InputError(f"{path}: no such study; must be a .toml file or {choices(known)}")
    return path


def read_study(
    path: Path,
    load: Load,
    preset: Preset = System.with_presets,
    metrics: Sequence[Metric] = (),
) -> Study:
    """The study of a TOML file; `load` reads its system, `preset` applies a preset to it.

    `metrics` are kept beside those that the file names. InputError where anything is wrong.
    """
    table = toml_table(path, "study")
    place = path.name
    check_keys(place, table, KEYS)
    design = as_table(f"{place}: [design]", table.get("design"))
    check_keys(f"{place}: [design]", design, Design.__slots__)
    if "kind" not in design:
        raise InputError(f"{place}: [design]: no kind; must have one")
    entries = table.get("parameters", [])
    if not isinstance(entries, list):
        raise InputError(f"{place}: parameters = {entries!r}: must be [[parameters]] tables")
    seeds = _names(f"{place}: seeds", table.get("seeds", []))
    random = design["kind"] != "grid" or seeds
    if random and "seed" not in design:
        raise InputError(f"{place}: [design]: no seed; must be a whole number, what is random")
    own_metrics: tuple[Metric, ...] = ()
    if "metrics" in table:
        file = text(f"{place}: metrics", table["metrics"], "the path of a Python file")
        own_metrics = load_metrics(path.parent / file)
    parameters = tuple(
        _parameter(f"{place}: parameters[{i}]", entry) for i, entry in enumerate(entries)
    )
    varied = {*seeds, *(v for p in parameters for v in p.variables)}
    return Study(
        place,
        _system(place, table, path.parent, (load, preset), varied),
        parameters,
        _in(place, lambda: Design(**design)),
        seeds,
        _names(f"{place}: outputs", table.get("outputs", [])),
        _pictures(f"{place}: [figures]", table.get("figures", {})),
        (*own_metrics, *metrics),
    )


def _system(
    place: str,
    table: Mapping[str, Any],
    folder: Path,
    made: tuple[Load, Preset],
    varied: set[str],
) -> System:
    """The system with what is the same in all runs."""
    name = table.get("system")
    if name is not None:
        name = folder / text(f"{place}: system", name, "the path of a .toml or .ssp file")
    presets = _presets(place, table)
    swaps = {
        key: folder / text(f"{place}: [swap]: {key}", fmu, "the path of an FMU")
        for key, fmu in as_table(f"{place}: [swap]", table.get("swap", {})).items()
    }
    fixed = as_table(f"{place}: [values]", table.get("values", {}))
    for key, value in fixed.items():
        _value(f"{place}: [values]: {key}", value)
        if key in varied:
            raise InputError(
                f"{place}: [values]: {key}: is varied by [[parameters]] or seeds, too; must be in "
                "one of them"
            )
    load, with_preset = made
    system = load(name)
    for said, preset in presets.items():
        system = _in(f"{place}: {said}", partial(with_preset, system, preset))
    revised = system.revised(swaps, fixed, (f"{place}: [swap]", f"{place}: [values]"))
    return _in(place, lambda: revised.with_experiment(table.get("step"), table.get("stop")))


def _presets(place: str, table: Mapping[str, Any]) -> dict[str, str]:
    """The presets that are asked for, by what asks for them."""
    found = {f"presets: {n}": n for n in _names(f"{place}: presets", table.get("presets", []))}
    bench, case = table.get("bench", False), table.get("case")
    if not isinstance(bench, bool):
        raise InputError(f"{place}: bench = {bench!r}: must be true or false")
    if bench:
        found["bench = true"] = "bench"
    if case is not None:
        found[f"case = {case}"] = f"case_{whole(f'{place}: case', case, 0)}"
    return found


def _parameter(place: str, entry: Any) -> Parameter:
    entry = as_table(place, entry)
    check_keys(place, entry, {"name", "variables", "ratio_to", *FORMS})
    variables = _names(f"{place}: variables", entry.get("variables"))
    if not variables:
        raise InputError(f"{place}: variables = []: must have at least one")
    name = entry.get("name", variables[0])
    ratio_to = entry.get("ratio_to")
    if not isinstance(name, str) or not name.strip() or not name.isprintable():
        raise InputError(f"{place}: name = {name!r}: must be a string of one line")
    if ratio_to is not None:
        text(f"{place}: ratio_to", ratio_to, "'component.variable'")
    given = [form for form in FORMS if form in entry]
    if len(given) != 1:
        raise InputError(
            f"{place}: {' and '.join(given) or 'no values'}; must have exactly one of "
            f"{choices(FORMS)}"
        )
    distribution = FORMS[given[0]](f"{place}: {given[0]}", entry[given[0]])
    return Parameter(name, variables, distribution, ratio_to)


def _values(place: str, entry: Any) -> Listed:
    if not isinstance(entry, list) or not entry or len(entry) > MOST_LEVELS:
        raise InputError(f"{place} = {entry!r}: must be a list of values")
    return Listed(tuple(_value(place, value) for value in entry))


def _spaced(logarithmic: bool, place: str, entry: Any) -> Listed:
    first, last, count = _numbers(place, entry, ["from", "to", "count"])
    if not count.is_integer() or not 2 <= count <= MOST_LEVELS:
        raise InputError(f"{place}: count = {count:g}: must be a whole number 2 to {MOST_LEVELS}")
    if logarithmic and not (first > 0.0 and last > 0.0):
        raise InputError(f"{place}: from {first:g} to {last:g}: must be greater than 0")
    if not math.isfinite(last - first):
        raise InputError(f"{place}: from {first:g} to {last:g}: must be nearer to each other")
    return spaced(first, last, int(count), logarithmic)


def _bounded(kind: type[Normal | Uniform], place: str, entry: Any) -> Distribution:
    numbers = _numbers(place, entry, [f.name for f in fields(kind)])
    return _in(place, lambda: kind(*numbers))


FORMS: Mapping[str, Callable[[str, Any], Distribution]] = {
    "values": _values,
    "linspace": partial(_spaced, False),
    "geomspace": partial(_spaced, True),
    "uniform": partial(_bounded, Uniform),
    "normal": partial(_bounded, Normal),
}
"""The ways to say what a parameter may be."""


def _pictures(place: str, table: Any) -> Pictures:
    table = as_table(place, table)
    check_keys(place, table, Pictures.__slots__)
    distributions = _names(f"{place}: distributions", table.get("distributions", []))
    if "map" not in table:
        return Pictures(None, distributions)
    entry = as_table(f"{place}: map", table["map"])
    check_keys(f"{place}: map", entry, Map.__slots__)
    x, y, of = (text(f"{place}: map: {key}", entry.get(key), "a name") for key in ("x", "y", "of"))
    limit = entry.get("limit")
    if limit is not None:
        limit = number(f"{place}: map: limit", limit)
    return Pictures(Map(x, y, of, limit), distributions)


def _numbers(place: str, entry: Any, names: Sequence[str]) -> list[float]:
    """The finite numbers of a table with exactly these names."""
    table = as_table(place, entry)
    check_keys(place, table, names)
    return [number(f"{place}: {name}", table.get(name)) for name in names]


def _names(place: str, entry: Any) -> tuple[str, ...]:
    if not isinstance(entry, list) or not all(isinstance(name, str) for name in entry):
        raise InputError(f"{place} = {entry!r}: must be a list of names")
    return tuple(entry)


def _value(place: str, value: Any) -> Value:
    if not isinstance(value, float | int | bool | str):
        raise InputError(f"{place} = {value!r}: must be a number, boolean or string")
    return value


def _in(place: str, make: Callable[[], Made]) -> Made:
    """Return what `make` returns; its InputError begins with the place."""
    try:
        return make()
    except InputError as error:
        raise InputError(f"{place}: {error}") from error
