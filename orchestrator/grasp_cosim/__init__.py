"""Fixed-step co-simulation of FMUs, and the grasp of the paper. Card: orchestrator/README.md."""

from .errors import InputError, SimulationError
from .grasp.system import grasp_system
from .master.simulation import simulate
from .realtime.options import Realtime
from .recording.result import Result
from .system.description import System

__all__ = [
    "InputError",
    "Realtime",
    "Result",
    "SimulationError",
    "System",
    "grasp_system",
    "simulate",
]
