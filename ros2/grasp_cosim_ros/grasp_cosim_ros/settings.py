"""The node's own parameters: what runs, and how it is coupled to its peers."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from grasp_cosim import InputError, System
from grasp_cosim.base.checks import choice, number, whole

from .model import single_fmu

Mode = Literal["lockstep", "clock"]
OnLoss = Literal["stop", "failsafe", "hold"]

STEP = 1e-3
"""s, the communication step of an FMU if no period is given."""

DESCRIPTIONS = {
    "fmu": "The FMU that runs. Its variables have names like fmu.force[1].",
    "system": "The system file that runs, if no FMU is given.",
    "without": "The component of the system whose place the peers take.",
    "topics": "The YAML file of the topics.",
    "mode": "lockstep: a step for each sample of all topics; clock: a step each period.",
    "period": "Time between two exchanges in s; 0 is a step of the system, or 1 ms for an FMU.",
    "stop": "Model time in s at which the node ends the exchange; 0 is never.",
    "timeout": "How long in s a step waits for samples; by the clock, how old they may be.",
    "misses_tolerated": "So many steps in a row may lack a sample. One more is the loss.",
    "on_loss": "What follows on the loss of the peers: stop, failsafe or hold.",
    "resume": "Lost peers that are back make the model begin again.",
    "stall": "By the clock: how late in s a step may begin before all peers count as lost.",
    "initiate": "In lockstep: this node sends the first sample. One of the peers must do so.",
    "publish_clock": "The node publishes the time of the model on /clock.",
    "out": "The folder for the result at each deactivation; empty for none.",
    "autostart": "The node configures and activates itself, and its process ends with its run.",
}


@dataclass(frozen=True, slots=True)
class Settings:
    """The parameters of the node, checked. Times are in s."""

    fmu: str = ""
    system: str = ""
    without: str = ""
    topics: str = ""
    mode: Mode = "lockstep"
    period: float = 0.0
    stop: float = 0.0
    timeout: float = 0.1
    misses_tolerated: int = 3
    on_loss: OnLoss = "stop"
    resume: bool = False
    stall: float = 0.1
    initiate: bool = False
    publish_clock: bool = False
    out: str = ""
    autostart: bool = False

    def __post_init__(self) -> None:
        if bool(self.fmu) == bool(self.system):
            raise InputError(
                f"fmu = {self.fmu!r}, system = {self.system!r}: must have one of the two"
            )
        if self.fmu and self.without:
            raise InputError(f"without = {self.without!r}: must be empty with an FMU")
        if not self.topics:
            raise InputError("topics = '': must be the YAML file of the topics")
        choice("mode", self.mode, ("lockstep", "clock"))
        choice("on_loss", self.on_loss, ("stop", "failsafe", "hold"))
        for name in ("period", "stop"):
            number(name, getattr(self, name), 0.0, 1e9, must="0 or a time in s")
        for name in ("timeout", "stall"):
            must = "a time in s from 1e-6 to 3600"
            number(name, getattr(self, name), 1e-6, 3600.0, must=must)
        must = "a whole number from 0 to 1000000000"
        whole("misses_tolerated", self.misses_tolerated, 0, 10**9, must=must)

    @property
    def in_lockstep(self) -> bool:
        """True where a step waits for its samples."""
        return self.mode == "lockstep"

    def model_system(self) -> System:
        """The system that the node runs.

        Raises:
            InputError: A file cannot be read, or there is no such component.
        """
        if self.fmu:
            return single_fmu(Path(self.fmu), self.period or STEP)
        system = System.load(self.system)
        return system.without(self.without) if self.without else system
