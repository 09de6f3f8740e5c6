"""Builds the proxy of an FMU: the same variables, in C, which a peer gives values to over UDP."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, get_args, get_type_hints

from ..base.si_units import BASE, Unit
from .contract import TYPES, Scalar, Variable
from .description import ERROR, WARNING, Description, Version
from .link import BUILD_SIZE, NAME_SIZE, PORT, Limit, LinkVariable, Signature

if TYPE_CHECKING:
    from .build import Plan
    from .package import Built

PROTOCOL = Path(__file__).parent / "link/README.md"

SECOND = Unit("s", tuple(int(name == "s") for name in BASE))

_TEXT = (0, 1023)
"""Bytes that a text of the settings has."""


class Settings(NamedTuple):
    """The parameters proxy.*, but for those of the outputs: type, unit, limits, description."""

    host: Annotated[str, "", _TEXT, "name or address of the peer"] = "127.0.0.1"
    port: Annotated[int, "", (1, 65535), "its UDP port"] = PORT
    timeout: Annotated[
        float, "s", (1e-6, 3600.0), "longest wait for the outputs of a step, by the clock"
    ] = 0.01  # the step of the original is no measure: 0.1 ms is less than many a network needs
    connect_timeout: Annotated[
        float, "s", (1e-3, 3600.0),
        "longest wait for an answer in initialisation mode, by the clock",
    ] = 5.0  # fmt: skip
    misses_tolerated: Annotated[
        int, "", (0, 2**31 - 1), "misses in a row before the peer is lost with one more"
    ] = 3
    greatest_lead: Annotated[
        float, "s", (0.0, 3600.0),
        "how far the outputs may be ahead of the step they answer, or behind; beyond: lost",
    ] = 0.1  # fmt: skip
    on_loss: Annotated[
        str, "", _TEXT, "hold: outputs stay; failsafe: proxy.failsafe.*; stop: fmi2Error"
    ] = "stop"
    resume: Annotated[
        bool, "", None, "ask whether a lost peer is back: the loop may then be initialised again"
    ] = False
    on_limit: Annotated[
        str, "", _TEXT, "clamp: a command beyond its limits is limited; trip: the peer is given up"
    ] = "clamp"
    key_file: Annotated[
        str, "", _TEXT, "file with a key shared with the peer, 16 bytes or more; empty: none"
    ] = ""
    name: Annotated[
        str,
        "",
        (0, NAME_SIZE - 1),
        "name of the peer; empty: that of this instance, later the peer's",
    ] = ""
    build: Annotated[
        str,
        "",
        (0, BUILD_SIZE - 1),
        "what the peer must have been built from; empty: any, later it",
    ] = ""


DEFAULTS = Settings()

_DIAGNOSTICS: Mapping[str, tuple[type[Scalar], str, str]] = {
    "state": (
        int, "",
        "0 not connected, 1 connected, 2 missing: outputs held, 3 lost: on_loss holds, "
        "4 back: to be initialised again",
    ),
    "missed": (int, "", "steps without an answer in time"),
    "consecutive_missed": (int, "", "steps missed since the last answer in time"),
    "late": (int, "", "answers that came after their step was given up"),
    "out_of_order": (int, "", "late answers after the answer to a newer step: dropped"),
    "duplicated": (int, "", "answers that had come already"),
    "rejected": (int, "", "datagrams that were malformed, foreign or not authentic"),
    "sessions": (int, "", "sessions begun; more than 1: the peer's model was set up again"),
    "trips": (int, "", "how often the peer put itself into its safe state in this session"),
    "limited": (int, "", "commands that were beyond their limits"),
    "implausible": (int, "", "answers with values that cannot have been measured: dropped"),
    "round_trip_time": (float, "s", "round trip of the newest answer"),
    "age": (
        float, "s",
        "simulation time since that which the outputs belong to; below 0: the peer is ahead",
    ),
    "lead": (float, "s", "by how far the newest answer in time was ahead of the step it answered"),
}  # fmt: skip
"""Type, unit and description of the outputs proxy.* by their names."""


Limits = Mapping[str, Limit]
"""By the name of a Real input what may be sent, by that of a Real output what is plausible."""

NO_LIMITS: Limits = {}

LARGEST_REAL = sys.float_info.max
"""In the place of an infinite limit, which no start value may be."""


def build_proxy(
    target: Path,
    original: Description,
    plan: "Plan",
    settings: Settings = DEFAULTS,
    limits: Limits = NO_LIMITS,
) -> "Built":
    """Build the proxy of an FMU for the platforms of a plan.

    Its parameters start at `settings` and `limits`.

    `original` has the name of the FMU's file, and of its variables the inputs, parameters and
    outputs that are exchanged, in this order. A proxy that is there with the same content is left
    only. ValueError where the stem of `target` is no identifier of C, a setting is out of its
    range, or a name is taken; CompilerError where a compiler fails.
    """
    from .build import with_binaries  # only here, as below: they take time to load
    from .package import write_members

    members = proxy_members(target, original, plan.fmi, settings, limits)
    fmus = with_binaries([(target.stem, members)], plan, networked=True)
    return write_members(target, fmus[target.stem])


def proxy_members(
    target: Path,
    original: Description,
    fmi: Version = 2,
    settings: Settings = DEFAULTS,
    limits: Limits = NO_LIMITS,
) -> dict[str, bytes]:
    """Return the files of a proxy but for the binaries, by name; ValueError as build_proxy()."""
    from .native.bench_header import wire
    from .native.sources import proxy_sources, with_description
    from .package import HASH, Model
    from .page import icon

    description = _description(target, original, settings, limits)
    signature = shared_signature(original.variables)
    generated = {
        "wire.h": f"{_LICENCE}#ifndef WIRE_H\n#define WIRE_H\n\n{_INCLUDED}\n"
        f"{wire('wire', signature)}\n#endif\n",
        "variables.h": _table(signature, description.variables),
    }
    card = _card(description.variables[len(original.variables) :])
    model = Model(description, card, {}, picture=icon("Proxy"))
    sources = proxy_sources(description.name, original.name, generated, HASH, fmi)
    return with_description(model, sources, fmi)


def own_variables(
    variables: Sequence[Variable], settings: Settings = DEFAULTS, limits: Limits = NO_LIMITS
) -> list[Variable]:
    """Return what only the proxy has: settings, hold, failsafe, limits, diagnostics.

    `variables` are those of the original; `settings` and `limits` are start values. ValueError
    where a limit is of none of its Real inputs and outputs.
    """
    outputs = [v for v in variables if v.causality == "output"]
    sent, measured = reals(variables, "input"), reals(variables, "output")
    for name in limits:
        if name not in {v.name for v in (*sent, *measured)}:
            raise ValueError(f"limit of {name}: must be of a Real input or output of the FMU")

    def add(name: str, kind: type[Scalar], unit: str, start: Scalar, *about: Any) -> None:
        added.append(Variable(f"proxy.{name}", kind, "parameter", unit, start, "fixed", *about))

    added: list[Variable] = []
    for name, hint in get_type_hints(Settings, include_extras=True).items():
        kind, unit, valid, text = get_args(hint)
        add(name, kind, unit, getattr(settings, name), valid, text)
    for v in outputs:
        text = f"{v.name} stays as it is while the peer is lost"
        add(f"hold.{v.name}", bool, "", False, None, text)
    for v in outputs:
        text = f"value of {v.name} while the peer is lost"
        add(f"failsafe.{v.name}", v.kind, v.unit, v.kind(), None, text, None, v.relative)
    for group, names, property_text in (
        (sent, ("min", "max", "rate"), "that is sent"),
        (measured, ("lowest", "highest", "fastest"), "that is plausible"),
    ):
        for v in group:
            limit = limits.get(v.name, Limit())
            low, high = max(limit.low, -LARGEST_REAL), min(limit.high, LARGEST_REAL)
            rate = limit.rate if isfinite(limit.rate) else 0.0
            lowest, highest, fastest = (f"{name}.{v.name}" for name in names)
            add(
                lowest,
                float,
                v.unit,
                low,
                None,
                f"lowest {v.name} {property_text}",
                None,
                v.relative,
            )
            add(
                highest,
                float,
                v.unit,
                high,
                None,
                f"highest {v.name} {property_text}",
                None,
                v.relative,
            )
            text = f"fastest change of {v.name} {property_text}, {v.unit or '1'}/s; 0: any"
            add(fastest, float, "", rate, (0.0, LARGEST_REAL), text)
    for name, (kind, unit, text) in _DIAGNOSTICS.items():
        variability = "continuous" if kind is float else "discrete"
        added.append(Variable(f"proxy.{name}", kind, "output", unit, None, variability, None, text))
    return added


def reals(variables: Sequence[Variable], causality: str) -> list[Variable]:
    """Return the Real variables of a causality."""
    return [v for v in variables if v.causality == causality and v.kind is float]


def shared_signature(variables: Sequence[Variable]) -> Signature:
    """Return the signature of the variables of an original."""
    shared = ((v.name, TYPES[v.kind], v.causality, v.unit or None) for v in variables)
    return Signature(tuple(LinkVariable(*v) for v in shared))  # type: ignore[arg-type]  # no String


def _description(
    target: Path, original: Description, settings: Settings, limits: Limits
) -> Description:
    name, file = target.stem, original.name
    if not (name.isascii() and name.isidentifier()) or target.suffix != ".fmu":
        must = "must be NAME.fmu, NAME of letters, digits and _, no digit first"
        raise ValueError(f"{target}: {must}")
    if taken := [v.name for v in original.variables if v.name.startswith("proxy.")]:
        raise ValueError(f"{file}: {taken[0]}: proxy. begins the names of a proxy's own")
    added = own_variables(original.variables, settings, limits)
    for v in added:
        if v.start is not None:
            v.check(v.start)
    return replace(
        original,
        name=name,
        summary=f"Proxy of {file}: a peer has its outputs, over UDP",
        variables=[*original.variables, *added],
        units={"s": SECOND, **(original.units or {})},
        has_states=False,
        statuses=(WARNING, ERROR),
    )


def _card(added: Sequence[Variable]) -> str:
    """Return the proxy's own variables and the protocol, in Markdown."""
    rows = []
    for v in added:
        start = "" if v.start is None else str(v.start).lower()
        limits = f"{v.limits[0]:g} to {v.limits[1]:g}" if v.limits and v.kind is not str else ""
        cells = (f"`{v.name}`", v.causality, v.type, v.unit, start, limits, v.description)
        rows.append(f"| {' | '.join(cell.replace('|', '&#124;') for cell in cells)} |\n")
    return (
        "## Variables of the proxy\n\n"
        "All others are those of the original.\n\n"
        "| variable | causality | type | unit | start | range | meaning |\n"
        f"|---|---|---|---|---|---|---|\n{''.join(rows)}\n"
        f"{PROTOCOL.read_text('utf-8')}"
    )


_LICENCE = "/* What a proxy and its peer say to each other, in bytes: README.md of the link. */\n"
_INCLUDED = "".join(
    f"#include <{header}.h>\n" for header in ("stdbool", "stddef", "stdint", "string")
)
_WHOLE = (-(2.0**31), 2.0**31 - 1.0)
"""What an Integer of the link holds."""


def _table(signature: Signature, variables: Sequence[Variable]) -> str:
    """Return variables.h: all variables, and the texts that Strings begin with.

    Of the original's no limits are checked here: the peer does so.
    """
    from .native.text import number, string

    texts: list[str] = []
    rows = ""
    for i, v in enumerate(variables):
        limits = v.limits if i >= len(signature.variables) else None
        low, high = limits or (_WHOLE if v.kind is int else (0.0, 0.0))
        start = len(texts) if v.kind is str else v.start or 0.0
        texts += [string(str(v.start))] if v.kind is str else []
        kind = f"KIND_{TYPES[v.kind].upper()}"
        cells = string(v.name), string(v.in_unit), kind, v.causality.upper()
        flags = v.variability == "fixed", limits is not None or v.kind is int
        numbers = ", ".join(number(float(x)) for x in (low, high, start))
        rows += f"    {{{', '.join(cells)}, {flags[0]:d},\n     {flags[1]:d}, {numbers}}},\n"
    shared = variables[: len(signature.variables)]
    sent, measured = reals(shared, "input"), reals(shared, "output")
    defined = {
        "N_REQUEST": len(signature.request),
        "N_ANSWER": len(signature.answer),
        "REQUEST_SIZE": 8 * len(signature.request),
        "ANSWER_SIZE": 8 * len(signature.answer),
        "N_SENT": len(sent),
        "N_MEASURED": len(measured),
        "N_VARIABLES": len(variables),
        "N_TEXTS": len(texts),
    }
    return (
        "/* The variables of a proxy, in the order of their value references. */\n"
        + "".join(f"#define {name} {value}\n" for name, value in defined.items())
        + '#include "variable.h"\n\n'
        + f"static const Variable variables[N_VARIABLES] = {{\n{rows}}};\n\n"
        + "static const char *const texts[N_TEXTS + 1] = {\n"
        + "".join(f"    {text},\n" for text in texts)
        + '    ""};\n'
        + _places("sent_reals", "N_SENT", sent, variables)
        + _places("measured_reals", "N_MEASURED", measured, variables)
    )


def _places(name: str, size: str, group: Sequence[Variable], among: Sequence[Variable]) -> str:
    """Return the table of where the variables of a group are, which C has never empty."""
    places = [among.index(v) for v in group]
    return f"\nstatic const int {name}[{size} + 1] = {{{', '.join(map(str, [*places, 0]))}}};\n"
