"""Imports FMPy without what is not used here, which takes longer to load than all the rest of it.

FMPy imports its reader of descriptions, its simulation and its tools with itself. Here they are
imported when somebody asks FMPy for them, as if they had always been there.
"""

import io
import sys
from contextlib import redirect_stdout
from importlib import import_module
from types import ModuleType
from typing import Any

HOMES = {
    "read_model_description": "model_description",
    "simulate_fmu": "simulation",
    "instantiate_fmu": "simulation",
    "plot_result": "util",
    "read_csv": "util",
    "write_csv": "util",
}
"""Where the functions are that FMPy imports with itself, and that are not used here."""


class _Unused(ModuleType):
    """Stands for a module of FMPy while FMPy is imported."""

    def __getattr__(self, name: str) -> None:
        if name.startswith("__"):
            raise AttributeError(name)


def _later(name: str) -> Any:
    """What FMPy has of this name, imported now."""
    if name in HOMES.values():
        return import_module(f"fmpy.{name}")
    if name not in HOMES:
        raise AttributeError(f"module 'fmpy' has no attribute {name!r}")
    return getattr(import_module(f"fmpy.{HOMES[name]}"), name)


def _import_what_is_used() -> None:
    unused = {f"fmpy.{home}": _Unused(home) for home in HOMES.values()}
    sys.modules.update(unused)
    try:
        module = import_module("fmpy")
    finally:
        for name in unused:
            del sys.modules[name]
    for version in (1, 2, 3):
        import_module(f"fmpy.fmi{version}")
    for name in HOMES:
        delattr(module, name)
    names = {name for name in vars(module) if not name.startswith("_")}
    vars(module).update(__getattr__=_later, __all__=sorted({*names, *HOMES, *HOMES.values()}))


with redirect_stdout(io.StringIO()):  # FMPy says there that its logger, not used here, is for x86
    if "fmpy" not in sys.modules:
        _import_what_is_used()
    import fmpy as fmpy
