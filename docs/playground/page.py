"""Puts the page together: what it shows, its scripts, and the components in WebAssembly.

    PYTHONPATH=docs .venv/bin/python -m playground.page     # make playground

makes the WebAssembly again where the C of the FMUs has changed, and writes docs/playground.html.
"""

from __future__ import annotations

import base64
import json
import tomllib
import zlib
from html import escape
from importlib.metadata import version
from pathlib import Path
from string import Template
from typing import Any

from grasp_cosim.base.files import write_text
from grasp_cosim.grasp.metrics import FINGERS, METRICS
from grasp_cosim.grasp.presets import CASES, SYSTEM
from grasp_cosim.grasp.scene import scene_script, scene_style
from grasp_cosim.report.traces_page import page_style, traces_script

from . import wasm
from .wasm import LAWS, MODELS, PLANTS, model, shipped

HERE = Path(__file__).parent

_TYPES = {"Real": 0, "Boolean": 1, "Integer": 2}
"""As play.c numbers them."""


def playground_html() -> str:
    """Return the page as text: the same for the same sources, to the byte."""
    components = shipped()
    state = {
        "system": page_system(),
        "metrics": [
            {
                "name": m.name, "title": m.title, "unit": m.display_unit, "factor": m.factor,
                "text": m.description, "reason": m.reason,
            }
            for m in METRICS
        ],
        "scene": _scene(),
        "marks": [],
    }  # fmt: skip
    own = (_text(f"{name}.js") for name in ("model", "metrics", "play"))
    return Template(_text("play.html")).substitute(
        style=page_style() + scene_style() + _text("play.css"),
        version=escape(version("grasp-cosim")),
        size=len(zlib.decompress(components)) // 1000,
        page=json.dumps(state, separators=(",", ":"), ensure_ascii=False).replace("<", "\\u003c"),
        wasm=base64.b64encode(components).decode("ascii"),
        script="\n".join([traces_script(), scene_script(), *own]),
    )


def _scene() -> dict[str, Any]:
    """The signals that the hand is drawn from, as grasp.js has them; contacts come with a run."""
    drawn = {q: {j: f"plant.{q}[{j}]" for j in FINGERS} for q in ("position", "gap")}
    drawn["contact_force"] = {j: f"plant.contact_force[{j}]" for j in FINGERS}
    drawn["actuator"] = {j: f"controller.force[{j}]" for j in FINGERS}
    target = "controller.target_position"
    signals = [*(name for of in drawn.values() for name in of.values()), target]
    return {**drawn, "target": target, "signals": signals, "toSi": {}, "contacts": []}


def page_system() -> dict[str, Any]:
    """Return what the scripts of the page know, as JSON has it."""
    system = tomllib.loads(SYSTEM.read_text("utf-8"))
    shown = tomllib.loads(_text("settings.toml"))
    components = system["components"]
    presets = system["presets"]
    return {
        "models": {name: _variables(name) for name in MODELS},
        "components": {name: c["fmu"].removesuffix(".fmu") for name, c in components.items()},
        "connections": [c.split(" -> ") for c in system["connections"]],
        "values": {
            f"{name}.{key}": value
            for name, c in components.items()
            for key, value in c.get("values", {}).items()
        },
        "step": system["experiment"]["step"],
        "stop": system["experiment"]["stop"],
        "plants": PLANTS,
        "laws": LAWS,
        "cases": [presets[f"case_{case}"] for case in CASES],
        "bench": presets["bench"],
        "groups": shown["groups"],
        "presets": shown["presets"],
    }


def _variables(name: str) -> list[list[Any]]:
    """Name, type, causality, unit, start and description of an FMU's variables, by reference."""
    return [
        [v.name, _TYPES.get(v.type), v.causality, v.unit, v.start, v.description]
        for v in model(name).description.variables
    ]


def _text(name: str) -> str:
    return (HERE / name).read_text("utf-8")


if __name__ == "__main__":
    wasm.main()
    write_text(HERE.with_suffix(".html"), playground_html())
