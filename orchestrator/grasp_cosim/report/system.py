"""A system for a notebook: the diagram of its connections, as pages have it, and its experiment."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from html import escape
from importlib.resources import files
from typing import Any

from ..base.text import counted
from ..system.parameters import Parameters
from ..system.settings import settings
from ..system.structure import Structure
from ..system.times import in_seconds
from .diagram import Link, diagram_svg
from .tables import number, text_table


def system_html(system: Structure) -> str:
    """The HTML of a system: its experiment, and its components with their connections."""
    step, stop = in_seconds(system.step_ns), in_seconds(system.stop_ns)
    count = counted(len(system.connections), "connection")
    experiment = f"{number(stop)} s in steps of {number(1e3 * step)} ms, {system.scheme}; {count}"
    units = {str(port): v.unit for port, v in system.observed.items()}
    svg = stand_alone(connections_svg(settings(system), units))
    return (
        f"<p><b>{escape(system.name)}</b>: {escape(experiment)}</p>"
        f'<div style="overflow:auto">{svg.replace(":root", ".diagram")}</div>'
    )


def parameters_html(parameters: Parameters) -> str:
    """The table of all parameters of a system."""
    return text_table(parameters.rows())


def connections_svg(settings: Mapping[str, Any], units: Mapping[str, str | None]) -> str:
    """The diagram of the connections in system.settings, with factors and faults on them.

    `units` are those of the outputs, by names like plant.gap[1].
    """
    faults: dict[str, list[str]] = {}
    for fault in settings["faults"]:
        faults.setdefault(fault["connection"], []).append(fault["kind"])
    links = []
    for c in settings["connections"]:
        label = [] if c["factor"] is None else [f"× {number(c['factor'])}"]
        label += [f"+ {number(c['offset'])}"] if c["offset"] else []
        label += faults.get(c["to"], [])
        source, target = (tuple(c[end].split(".", 1)) for end in ("from", "to"))
        links.append(Link(source, target, ", ".join(label), fault=c["to"] in faults))
    boxes = {name: c["fmu"] for name, c in settings["components"].items()}
    return diagram_svg(boxes, links, units)


def stand_alone(svg: str) -> str:
    """A diagram with its style and its background, for where no page gives them."""
    head, tag, rest = svg.partition("<defs>")
    head = head.replace("<svg ", '<svg class="diagram" ', 1)
    backing = '<rect width="100%" height="100%" rx="8" fill="var(--paper)"/>'
    return f"{head}<style>\n{_style()}</style>{backing}{tag}{rest}"


@cache
def _style() -> str:
    """The part of the pages' style that is of its colours and of a diagram."""
    css = (files(__package__) / "page/page.css").read_text("utf-8")
    colors, _, _ = css.partition("* {")
    rules = re.findall(r"^(?:\.diagram [.t]|#tip)[^{]*\{[^}]*\}\n", css, re.MULTILINE)
    return colors + "".join(rules)
