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
from .diagram import Arrow, diagram_svg
from .html_tables import text_table
from .wording import number


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
    arrows = []
    for connection in settings["connections"]:
        target = connection["to"]
        labels = []
        if connection["factor"] is not None:
            labels.append(f"× {number(connection['factor'])}")
        if connection["offset"]:
            labels.append(f"+ {number(connection['offset'])}")
        labels += faults.get(target, [])
        ports = _port(connection["from"]), _port(target)
        arrows.append(Arrow(*ports, ", ".join(labels), fault=target in faults))
    components = {name: c["fmu"] for name, c in settings["components"].items()}
    return diagram_svg(components, arrows, units)


def _port(text: str) -> tuple[str, str]:
    """The component and the variable of a port like plant.gap[1]."""
    component, _, variable = text.partition(".")
    return component, variable


def stand_alone(svg: str) -> str:
    """A diagram with its style and its background, for where no page gives them."""
    opening, defs, drawing = svg.partition("<defs>")
    opening = opening.replace("<svg ", '<svg class="diagram" ', 1)
    background = '<rect width="100%" height="100%" rx="8" fill="var(--paper)"/>'
    return f"{opening}<style>\n{_style()}</style>{background}{defs}{drawing}"


@cache
def _style() -> str:
    """The rules of the pages' style for the colours and for a diagram."""
    css = (files(__package__) / "page/page.css").read_text("utf-8")
    colors, _, _ = css.partition("* {")
    rules = re.findall(r"^(?:\.diagram [.t]|#tip)[^{]*\{[^}]*\}\n", css, re.MULTILINE)
    return colors + "".join(rules)
