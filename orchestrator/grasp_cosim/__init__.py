"""Fixed-step co-simulation of FMUs, and the grasp of the paper. See orchestrator/README.md.

    from grasp_cosim import grasp_system, simulate

    system = grasp_system().with_values({"plant.initial_object_position": 0.02})
    result = simulate(system, stop=3.0)
    result.metrics["time_to_contact"], result["plant.gap[1]"], result.units["plant.gap[1]"]
    result.plot("grasp.png")

Importing it imports nothing yet, builds nothing and writes nothing: each name below is imported
when it is asked for. Further in: `grasp_cosim.metrics.metric`,
`grasp_cosim.metrics.groups`, `grasp_cosim.sweeps.sweep`,
`grasp_cosim.exchange.listener`, `grasp_cosim.recording.csv`, `grasp_cosim.recording.mdf`,
`grasp_cosim.comparison.compare`, `grasp_cosim.comparison.qualify`, `grasp_cosim.comparison.bands`.
"""

from __future__ import annotations

from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING

from .base.errors import InputError, RunInterruptedError, SimulationError
from .base.registry import Kind, register

if TYPE_CHECKING:
    __version__: str
    from .base.quantity import Quantity
    from .comparison.changes import diff
    from .comparison.compare import compare
    from .comparison.qualify import qualify
    from .grasp.delicate import delicate_system
    from .grasp.identification.identification import identify
    from .grasp.published.evaluation import evaluate
    from .grasp.system import grasp_system
    from .hand.system import hand_system
    from .inspection.declarations import inspect_fmu
    from .linearisation.linearise import linearise
    from .linearisation.state_space import StateSpace
    from .master.session import Session
    from .master.simulation import simulate
    from .metrics.metric import AnyOf, Metric, metric
    from .recording.read_back import load_run
    from .recording.result import Result
    from .report.run_report import write_report
    from .ssp.to_archive import write_ssp
    from .sweeps.sweep import sweep
    from .system.description import System
    from .system.parts import Realtime
    from .tandem.system import tandem_system

__all__ = [
    "AnyOf",
    "InputError",
    "Metric",
    "Quantity",
    "Realtime",
    "Result",
    "RunInterruptedError",
    "Session",
    "SimulationError",
    "StateSpace",
    "System",
    "compare",
    "delicate_system",
    "diff",
    "evaluate",
    "grasp_system",
    "hand_system",
    "identify",
    "inspect_fmu",
    "linearise",
    "load_run",
    "metric",
    "qualify",
    "simulate",
    "sweep",
    "tandem_system",
    "write_report",
    "write_ssp",
]

_MODULES = {
    "AnyOf": "metrics.metric",
    "Metric": "metrics.metric",
    "Quantity": "base.quantity",
    "Realtime": "system.parts",
    "Result": "recording.result",
    "Session": "master.session",
    "StateSpace": "linearisation.state_space",
    "System": "system.description",
    "compare": "comparison.compare",
    "delicate_system": "grasp.delicate",
    "diff": "comparison.changes",
    "evaluate": "grasp.published.evaluation",
    "grasp_system": "grasp.system",
    "hand_system": "hand.system",
    "identify": "grasp.identification.identification",
    "inspect_fmu": "inspection.declarations",
    "linearise": "linearisation.linearise",
    "load_run": "recording.read_back",
    "metric": "metrics.metric",
    "qualify": "comparison.qualify",
    "simulate": "master.simulation",
    "sweep": "sweeps.sweep",
    "tandem_system": "tandem.system",
    "write_report": "report.run_report",
    "write_ssp": "ssp.to_archive",
}
"""The modules of the public names, by which these are imported when they are asked for."""


def _imported(home: str, name: str) -> object:
    """What has that name in the module of that name in this package."""
    return getattr(import_module(f".{home}", __name__), name)


_FOR_LOWER_PACKAGES: tuple[tuple[Kind, str, str, str], ...] = (
    ("blocks", ".py", "fmu_export.build", "kept_block"),
    ("groups", "grasp", "grasp.group", "GROUP"),
    ("groups", "hand", "hand.group", "GROUP"),
    ("groups", "tandem", "tandem.group", "GROUP"),
    ("html", "Parameters", "report.system_html", "parameters_html"),
    ("html", "Result", "report.html_tables", "result_html"),
    ("html", "System", "report.system_html", "system_html"),
    ("pictures", "Result", "report.plot", "plot_signals"),
    ("readers", ".json", "recording.as_system", "read_run_as_system"),
    ("readers", ".ssp", "ssp.from_archive", "read_ssp"),
    ("twins", "System", "twins.twins", "natives"),
)
"""What lower packages get of upper ones, see base.registry: kind, name, home, its name there."""

for _kind, _name, _home, _item in _FOR_LOWER_PACKAGES:
    register(_kind, _name, partial(_imported, _home, _item))


def __dir__() -> list[str]:
    return [*__all__, *(name for name in globals() if name.startswith("__")), "__version__"]


if not TYPE_CHECKING:  # who checks types knows the names above, and no others

    def __getattr__(name):
        if name == "__version__":
            from importlib.metadata import version

            value = version("grasp-cosim")
        elif name in _MODULES:
            value = _imported(_MODULES[name], name)
        else:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        globals()[name] = value
        return value
