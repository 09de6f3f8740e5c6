"""A study from a TOML file, in the format that docs/studies.md describes."""

import math
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from ..checks import (
    as_table,
    check_keys,
    check_values,
    choice,
    known,
    number,
    text,
    toml_table,
    whole,
)
from ..errors import InputError, choices, nearest
from ..interface.interface import Value
from ..metrics.metric import Metric, load_metrics
from ..system.description import System
from .design import Design
from .distributions import Distribution, Listed, Normal, Uniform, spaced
from .study import CELLS, STATISTICS, Curve, Limit, Map, Parameter, Pictures, Study

OF_A_VARIANT = {
    "presets", "bench", "case", "controller", "step", "stop", "swap", "values", "limits",
}  # fmt: skip
"""Keys that a variant may have as well: there they go before what the study says."""

KEYS = OF_A_VARIANT | {
    "system",
    "metrics",
    "seeds",
    "outputs",
    "design",
    "parameters",
    "figures",
    "variants",
}

PLAIN = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")
"""The name of a variant, which is that of a folder, too."""

T = TypeVar("T")
Load = Callable[[Path | None], System]
"""Reads a system; None stands for the built-in one."""

Change = Callable[[System, str], System]
"""Changes a system as the name of a preset says."""


def _no_controller(_: System, name: str, __: Collection[str]) -> System:
    raise InputError(f"controller {name!r}: there are none by name; must be a swap")


@dataclass(frozen=True, slots=True)
class Made:
    """How the systems of studies are made.

    `load` reads one, `preset` and `controller` change it, the latter with the names of what [swap]
    replaces. `fmus` is where FMUs under [swap] are, None for beside the study. `law` is the
    controller for a study that names none.
    """

    load: Load
    preset: Change = System.with_presets
    controller: Callable[[System, str, Collection[str]], System] = _no_controller
    fmus: Path | None = None
    law: str | None = None


MOST_LEVELS = 100_000
"""Values of one parameter at most."""


def study_file(name: str, folder: Path) -> Path:
    """The file of a study, given by its path or by the name of one in the folder of studies."""
    path, known = Path(name), sorted(p.stem for p in folder.glob("*.toml"))
    if path.suffix != ".toml" and name in known:
        return folder / f"{name}.toml"
    if not path.is_file():
        raise InputError(f"{path}: no such study, nor .toml file; {nearest(name, known)}")
    return path


def read_studies(
    path: Path, made: Made, metrics: Sequence[Metric] = (), seed: int | None = None
) -> tuple[Study, ...]:
    """The variants of the study of a TOML file, or the one that it is.

    `metrics` are kept beside those that the file names; `seed` goes before its own. InputError
    where anything is wrong.
    """
    table = toml_table(path, "study")
    place = path.name
    check_keys(place, table, KEYS)
    if seed is not None:
        table["design"] = _drawn_anew(place, table, seed)
    if "variants" not in table:
        alone = _study(place, "", table, path.parent, made, metrics)
        _check_references([alone])
        return (alone,)
    entries = table.pop("variants")
    if not isinstance(entries, list) or not entries:
        raise InputError(f"{place}: variants = {entries!r}: must be [[variants]] tables")
    names = [_variant(f"{place}: variants[{i}]", entry) for i, entry in enumerate(entries)]
    twice = next((n for n in names if names.count(n) > 1), None)
    if twice is not None:
        raise InputError(f"{place}: variant {twice!r} twice; must be there once")
    studies = tuple(
        _study(f"{place}, {name}", name, _merged(table, entry), path.parent, made, metrics)
        for name, entry in zip(names, entries, strict=True)
    )
    _check_references(studies)
    return studies


def _check_references(studies: Sequence[Study]) -> None:
    """InputError where a limit is from a variant that is not there."""
    names = [study.variant for study in studies if study.variant]
    for study in studies:
        for limit in study.limits:
            if limit.reference is not None:
                known(f"{study.name}: limits: from: no variant", limit.reference, names)


def _study(
    place: str,
    variant: str,
    table: Mapping[str, Any],
    folder: Path,
    made: Made,
    metrics: Sequence[Metric],
) -> Study:
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
        own_metrics = load_metrics(folder / file)
    parameters = tuple(
        _parameter(f"{place}: parameters[{i}]", entry) for i, entry in enumerate(entries)
    )
    varied = {*seeds, *(v for p in parameters for v in p.variables)}
    return Study(
        place,
        _system(place, table, folder, made, varied),
        parameters,
        _in(place, lambda: Design(**design)),
        seeds,
        _names(f"{place}: outputs", table.get("outputs", [])),
        _pictures(f"{place}: [figures]", table.get("figures", {})),
        (*own_metrics, *metrics),
        _limits(f"{place}: [limits]", table.get("limits", {})),
        variant,
    )


def _drawn_anew(place: str, table: Mapping[str, Any], seed: int) -> dict[str, Any]:
    """The design with another seed; InputError where nothing goes by it."""
    design = as_table(f"{place}: [design]", table.get("design"))
    if design.get("kind") == "grid" and not table.get("seeds"):
        raise InputError(f"--seed {seed}: {place} has nothing that is random; must be left out")
    return {**design, "seed": seed}


def _variant(place: str, entry: Any) -> str:
    """The name of a variant; InputError where it is none, or has what variants share."""
    entry = as_table(place, entry)
    check_keys(place, entry, {"name", *OF_A_VARIANT})
    name = entry.get("name")
    if not isinstance(name, str) or not PLAIN.fullmatch(name):
        raise InputError(f"{place}: name = {name!r}: must be letters, digits, '-', '_' and '.'")
    return name


def _merged(table: Mapping[str, Any], entry: Mapping[str, Any]) -> dict[str, Any]:
    """What a variant says goes before what the study says; tables are put together."""
    merged = {**table, **{k: v for k, v in entry.items() if k != "name"}}
    for key in ("swap", "values", "limits"):
        both = [t[key] for t in (table, entry) if key in t]
        if len(both) > 1 and all(isinstance(t, dict) for t in both):
            merged[key] = {**both[0], **both[1]}
    return merged


def _system(
    place: str,
    table: Mapping[str, Any],
    folder: Path,
    made: Made,
    varied: set[str],
) -> System:
    """The system with what is the same in all runs."""
    name = table.get("system")
    if name is not None:
        name = folder / text(f"{place}: system", name, "the path of a .toml or .ssp file")
    presets = _presets(place, table)
    swaps = {
        key: (made.fmus or folder) / text(f"{place}: [swap]: {key}", fmu, "the path of an FMU")
        for key, fmu in as_table(f"{place}: [swap]", table.get("swap", {})).items()
    }
    fixed = as_table(f"{place}: [values]", table.get("values", {}))
    check_values(f"{place}: [values]", fixed)
    for key in fixed:
        if key in varied:
            raise InputError(
                f"{place}: [values]: {key}: is varied by [[parameters]] or seeds, too; must be in "
                "one of them"
            )
    system = made.load(name)
    law = _law(place, table, made)
    if law is not None:
        system = _in(place, partial(made.controller, system, law, swaps))
    for said, preset in presets.items():
        system = _in(f"{place}: {said}", partial(made.preset, system, preset))
    revised = system.revised(swaps, fixed, (f"{place}: [swap]", f"{place}: [values]"))
    return _in(place, lambda: revised.with_experiment(table.get("step"), table.get("stop")))


def _law(place: str, table: Mapping[str, Any], made: Made) -> str | None:
    """The name of the controller, if one is asked for; InputError where it is so twice."""
    own = table.get("controller")
    if own is None:
        return made.law
    if made.law is not None:
        raise InputError(
            f"{place}: --controller {made.law}: must be left out, the study names {own!r}"
        )
    return text(f"{place}: controller", own, "the name of one")


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


def spaced_values(logarithmic: bool, place: str, entry: Any) -> Listed:
    """The values of a table like { from = 0.5, to = 2.0, count = 21 }; InputError if it is none."""
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
    "linspace": partial(spaced_values, False),
    "geomspace": partial(spaced_values, True),
    "uniform": partial(_bounded, Uniform),
    "normal": partial(_bounded, Normal),
}
"""The ways to say what a parameter may be."""


def _pictures(place: str, table: Any) -> Pictures:
    table = as_table(place, table)
    check_keys(place, table, {"map", "distributions", "curve"})
    distributions = _names(f"{place}: distributions", table.get("distributions", []))
    maps = _each(f"{place}: map", table.get("map", []), ("x", "y", "of"))
    curves = _each(f"{place}: curve", table.get("curve", []), ("x", "of"))
    return Pictures(tuple(Map(**m) for m in maps), distributions, tuple(Curve(**c) for c in curves))


def _each(place: str, entry: Any, names: Sequence[str]) -> list[dict[str, Any]]:
    """A table, or each of a list of such, with these names and what maps and curves may have."""
    return [_over(place, e, names) for e in (entry if isinstance(entry, list) else [entry])]


def _over(place: str, entry: Any, names: Sequence[str]) -> dict[str, Any]:
    entry = as_table(place, entry)
    check_keys(place, entry, (*names, "limit", "cell"))
    named = {name: text(f"{place}: {name}", entry.get(name), "a name") for name in names}
    limit = entry.get("limit")
    if limit is not None:
        limit = number(f"{place}: limit", limit)
    cell = choice(f"{place}: cell", entry.get("cell", "mean"), CELLS)
    return {**named, "limit": limit, "cell": cell}


def _limits(place: str, table: Any) -> tuple[Limit, ...]:
    """The limits of a table like time_difference = { greatest = 0.03, p95 = 0.02 }."""
    found = []
    for metric, entry in as_table(place, table).items():
        at = f"{place}: {metric}"
        own = as_table(at, entry)
        check_keys(at, own, {*STATISTICS, "from"})
        reference = own.get("from")
        if reference is not None:
            reference = text(f"{at}: from", reference, "the name of a variant")
        bounds = {s: number(f"{at}: {s}", own[s]) for s in STATISTICS if s in own}
        if not bounds:
            raise InputError(f"{at}: no limit; must have one of {choices(STATISTICS)}")
        found += [Limit(metric, s, most, reference) for s, most in bounds.items()]
    return tuple(found)


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


def _in(place: str, make: Callable[[], T]) -> T:
    """Return what `make` returns; its InputError begins with the place."""
    try:
        return make()
    except InputError as error:
        raise InputError(f"{place}: {error}") from error
