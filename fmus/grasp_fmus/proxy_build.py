"""Builds the proxy of an FMU: the same variables, and a slave that asks a peer for the outputs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from .description import UNITS, Description, Experiment, Unit
from .host_log import ERROR, WARNING
from .package import Built, Model, write_python
from .page import icon
from .proxy import DEFAULTS, Settings, bounded, own_variables
from .variable import Variable


@dataclass(frozen=True)
class Original:
    """The FMU whose place a proxy takes; `file` is its name.

    `variables` are its inputs, parameters and outputs, in this order.
    """

    file: str
    variables: Sequence[Variable]
    units: Mapping[str, Unit]
    experiment: Experiment
    can_vary_step: bool


def build_proxy(
    target: Path,
    original: Original,
    settings: Settings = DEFAULTS,
) -> Built:
    """Build the proxy of an FMU; its own parameters start at `settings`.

    A proxy that is there with the same content is left alone.
    ValueError where the stem of `target` is no identifier of C, a setting is out of its range, a
    text is too long to be sent, or a name is taken.
    """
    return write_python(target, proxy_model(target, original, settings))


def proxy_model(target: Path, original: Original, settings: Settings) -> Model:
    """Return the model of the proxy of an FMU; ValueError as build_proxy()."""
    name = target.stem
    if not (name.isascii() and name.isidentifier()) or target.suffix != ".fmu":
        raise ValueError(
            f"{target.name}: must be NAME.fmu, NAME of letters, digits and _, no digit first"
        )
    taken = [v.name for v in original.variables if v.name.startswith("proxy.")]
    if taken:
        raise ValueError(f"{original.file}: {taken[0]}: proxy. begins the names of a proxy's own")
    own = own_variables([v for v in original.variables if v.causality == "output"], settings)
    for v in bounded([*original.variables, *own], len(original.variables)):
        if v.start is not None:
            v.check(v.start)
    description = Description(
        name,
        f"Proxy of {original.file}: a peer has its outputs, over UDP",
        [*original.variables, *own],
        {"s": UNITS["s"], **original.units},
        original.can_vary_step,
        has_states=False,
        experiment=original.experiment,
        statuses=(WARNING, ERROR),
    )
    return Model(
        description,
        _card(own),
        {f"{name}.py": _script(name, original, settings).encode()},
        picture=icon("Proxy"),
    )


def _script(name: str, original: Original, settings: Settings) -> str:
    """Return the script of the FMU: all that its slave needs to know of the original."""
    lines = [
        f"        Variable({v.name!r}, {v.kind.__name__}, {v.causality!r}, {v.unit!r}, "
        f"{v.start!r}, {v.variability!r}),\n"
        for v in original.variables
    ]
    return (
        f"from grasp_fmus import proxy\nfrom grasp_fmus.variable import Variable\n\n\n"
        f"class {name}(proxy.Fmi2Proxy):\n"
        f"    original = {original.file!r}\n"
        f"    settings = proxy.{settings!r}\n"
        f"    variables = (\n{''.join(lines)}    )\n"
    )


def _card(own: Sequence[Variable]) -> str:
    """Return the proxy's own variables and the protocol, in Markdown."""
    protocol = Path(__file__).parent / "link" / "README.md"
    rows = []
    for v in own:
        start = "" if v.start is None else str(v.start).lower()
        limits = f"{v.limits[0]:g} to {v.limits[1]:g}" if v.limits else ""
        cells = (f"`{v.name}`", v.causality, v.type, v.unit, start, limits, v.description)
        rows.append(f"| {' | '.join(cell.replace('|', '&#124;') for cell in cells)} |\n")
    return (
        "## Variables of the proxy\n\n"
        "All others are those of the original.\n\n"
        "| variable | causality | type | unit | start | range | meaning |\n"
        f"|---|---|---|---|---|---|---|\n{''.join(rows)}\n"
        f"{protocol.read_text('utf-8')}"
    )
