"""The system of the page: the built-in grasp, its components' variables, the settings shown."""

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

from grasp_cosim.grasp.controllers import CONTROLLERS
from grasp_cosim.grasp.presets import CASES, SYSTEM
from grasp_fmus.package import Model, shipped_model

PLANTS = {
    "fixed": "GripperPlant",
    "soft": "GripperPlantCompliant",
    "movable": "GripperPlantMovable",
}
"""The plants to choose from, by what the object does."""

LAWS = {name: f"GraspController{law}" for name, law in CONTROLLERS.items()}

MODELS = (*PLANTS.values(), "ProximitySensor", *LAWS.values())
"""The FMUs that are in play.wasm, in the order of its kinds."""

WASM = Path(__file__).with_name("play.wasm.z")
"""The components in WebAssembly, deflated, as pages have it; wasm.py makes it."""

_TYPES = {"Real": 0, "Boolean": 1, "Integer": 2}
"""As play.c numbers them."""


@cache
def model(name: str) -> Model:
    """Return the model of an FMU that comes with the package."""
    return shipped_model(name)


def shipped() -> bytes:
    """Return play.wasm.z as it is."""
    return WASM.read_bytes()


def page_system() -> dict[str, Any]:
    """Return what the scripts of the page know, as JSON has it."""
    system = tomllib.loads(SYSTEM.read_text("utf-8"))
    shown = tomllib.loads(WASM.with_name("settings.toml").read_text("utf-8"))
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
    """The variables of an FMU that a page can set or get, by value reference.

    Name, type, causality, unit, start and description each.
    """
    return [
        [v.name, _TYPES.get(v.type), v.causality, v.unit, v.start, v.description]
        for v in model(name).description.variables
    ]
