"""Fixed-step co-simulation of FMUs, and the grasp of the paper. Card: orchestrator/README.md.

    from grasp_cosim import grasp_system, simulate

    system = grasp_system().with_values({"plant.initial_object_position": 0.02})
    result = simulate(system, stop=3.0)
    result.metrics["time_to_contact"], result["plant.gap[1]"], result.units["plant.gap[1]"]
    result.plot("grasp.png")

Importing it imports nothing yet, builds nothing and writes nothing: each name below is imported
when it is asked for. Further in: `grasp_cosim.metrics.metric`, `grasp_cosim.sweeps.sweep`,
`grasp_cosim.recording.listener`, `grasp_cosim.recording.csv`, `grasp_cosim.recording.mdf`,
`grasp_cosim.comparison.compare`, `grasp_cosim.comparison.qualify`, `grasp_cosim.comparison.bands`.
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from . import extensions
from .base.errors import InputError, SimulationError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from matplotlib.figure import Figure

    from .comparison.compare import compare
    from .comparison.qualify import qualify
    from .grasp.identification.identification import identify
    from .grasp.published.evaluation import evaluate
    from .grasp.system import grasp_system
    from .inspection.inspection import inspect_fmu
    from .master.simulation import Session, simulate
    from .metrics.metric import Metric, metric
    from .recording.load import load_run
    from .recording.result import Result
    from .report.page import Scene
    from .report.written import write_report
    from .ssp.write import write_ssp
    from .sweeps.sweep import sweep
    from .system.description import System
    from .system.realtime import Realtime
    from .system.stimuli import Stimuli

__all__ = [
    "InputError",
    "Metric",
    "Realtime",
    "Result",
    "Session",
    "SimulationError",
    "System",
    "compare",
    "evaluate",
    "grasp_system",
    "identify",
    "inspect_fmu",
    "load_run",
    "metric",
    "qualify",
    "simulate",
    "sweep",
    "write_report",
    "write_ssp",
]

_HOMES = {
    "Metric": "metrics.metric",
    "Realtime": "system.realtime",
    "Result": "recording.result",
    "Session": "master.simulation",
    "System": "system.description",
    "compare": "comparison.compare",
    "evaluate": "grasp.published.evaluation",
    "grasp_system": "grasp.system",
    "identify": "grasp.identification.identification",
    "inspect_fmu": "inspection.inspection",
    "load_run": "recording.load",
    "metric": "metrics.metric",
    "qualify": "comparison.qualify",
    "simulate": "master.simulation",
    "sweep": "sweeps.sweep",
    "write_report": "report.written",
    "write_ssp": "ssp.write",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f".{_HOMES[name]}", __name__), name)
    globals()[name] = value
    return value


def _read_toml(
    path: Path,
    fmus: Path | None,
    step: float | None,
    stop: float | None,
    stimuli: Stimuli | None,
) -> System:
    from .system.toml import read_toml

    return read_toml(path, fmus, stimuli).with_experiment(step, stop)


def _read_ssp(
    path: Path,
    fmus: Path | None,
    step: float | None,
    stop: float | None,
    stimuli: Stimuli | None,
) -> System:
    from .ssp.read import read_ssp

    if fmus is not None:
        raise InputError(f"{path}: has its own FMUs; those in {fmus} cannot take their place")
    return read_ssp(path, step, stop, stimuli)


def _grasp_metrics() -> tuple[Metric, ...]:
    from .grasp.metrics import METRICS

    return METRICS


def _is_grasp(result: Result) -> bool:
    from .grasp.metrics import is_grasp

    return is_grasp(result.by_role)


def _draw_grasp(result: Result, path: Path | None) -> Figure:
    from .grasp.pictures import draw_grasp

    return draw_grasp(result, path)


def _grasp_scene(result: Result) -> Scene | None:
    from .grasp.scene import grasp_scene

    return grasp_scene(result)


def _grasp_traits(result: Result) -> Mapping[str, str]:
    from .grasp.presets import case_of

    return {"case": case_of(result.settings)}


def _grasp_words(result: Result) -> Sequence[str]:
    from .grasp.presets import words_of

    return words_of(result.settings)


def _draw_signals(result: Result, path: Path | None) -> Figure:
    from .report.plot import plot_signals

    return plot_signals(result, path)


def _html(result: Result) -> str:
    from .report.tables import result_html

    return result_html(result)


extensions.readers |= {".toml": _read_toml, ".ssp": _read_ssp}
if find_spec(f"{__name__}.grasp"):
    extensions.metrics["grasp"] = _grasp_metrics
    extensions.drawings.append(
        extensions.Drawing(
            "grasp", _is_grasp, _draw_grasp, _grasp_scene, _grasp_traits, _grasp_words
        )
    )
extensions.html.append(_html)
extensions.drawings.append(extensions.Drawing("signals", lambda _: True, _draw_signals))
