"""A study without a file: parameters that vary over listed values, in every combination."""

from collections.abc import Sequence

from ..checks import known
from ..errors import InputError
from ..interface.interface import Value
from ..metrics.metric import Metric, available, registered
from ..system.description import System
from .design import Design
from .distributions import Listed
from .read import spaced_values
from .study import Curve, Map, Parameter, Pictures, Study

VARY = "--vary"
FORM = "COMPONENT.VARIABLE=START:END:COUNT or =VALUE,VALUE,..."


def parameter(text: str) -> Parameter:
    """The parameter of a text like plant.object_width=0.05:0.07:3, or =0.05,0.06,0.07.

    Values are in the unit of the FMU: numbers, true, false, or the names of an enumeration's items.
    InputError where it is no such text.
    """
    name, equals, said = text.partition("=")
    place = f"{VARY} {text!r}"
    if not (equals and all(name.partition("."))):
        raise InputError(f"{place}: must be {FORM}")
    bounds = said.split(":")
    if len(bounds) == 1:
        values = tuple(_value(part.strip()) for part in said.split(","))
        if "" in values:
            raise InputError(f"{place}: an empty value; must be {FORM}")
        return Parameter(name, (name,), Listed(values))
    if len(bounds) != 3:
        raise InputError(f"{place}: {len(bounds)} numbers between colons; must be {FORM}")
    entry = dict(zip(("from", "to", "count"), map(_value, bounds), strict=True))
    return Parameter(name, (name,), spaced_values(False, place, entry))


def varied(
    system: System,
    texts: Sequence[str],
    of: Sequence[str] = (),
    metrics: Sequence[Metric] = (),
    *,
    plot: bool = False,
) -> Study:
    """The study of a grid over what the texts vary, each as for parameter().

    `of` are metrics or signals of the system; of the latter the last value is kept. `metrics` are
    there beside those that every result is asked for. With `plot` it has pictures of what is in
    `of`, by default of the primary metrics: curves over one parameter, maps over two. InputError
    where anything does not fit.
    """
    parameters = tuple(map(parameter, texts))
    signals = [str(port) for port in system.recorded]
    there = available(registered(metrics), signals, system.roles)[0]
    columns = {m.name: m.columns for m in there}
    columns |= {c: (c,) for c in (*(c for m in there for c in m.columns), *signals)}
    for name in of:
        known("--of: no metric or signal", name, columns)
    asked = tuple(of) or tuple(m.name for m in there if m.primary)
    return Study(
        VARY,
        system,
        parameters,
        Design("grid"),
        outputs=tuple(dict.fromkeys(name for name in of if name in signals)),
        pictures=_pictures(parameters, asked, columns) if plot else Pictures(),
        metrics=tuple(metrics),
    )


def _pictures(
    parameters: Sequence[Parameter], of: Sequence[str], columns: dict[str, tuple[str, ...]]
) -> Pictures:
    """A curve of each of the names, or a map of each of their columns."""
    names = [p.name for p in parameters]
    if len(names) > 2:
        raise InputError(
            f"--plot: {len(names)} parameters vary; must be one or two, or a study that says what "
            "to draw"
        )
    if not of:
        raise InputError("--plot: no metric to draw by default; must have --of METRIC or SIGNAL")
    if len(names) == 1:
        return Pictures(curves=tuple(Curve(names[0], name) for name in dict.fromkeys(of)))
    each = dict.fromkeys(column for name in of for column in columns[name])
    return Pictures(tuple(Map(names[0], names[1], column) for column in each))


def _value(text: str) -> Value:
    """The value of a text, as a TOML file would have it without quotes."""
    if text in ("true", "false"):
        return text == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
