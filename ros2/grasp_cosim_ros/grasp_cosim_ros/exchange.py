"""The exchange of a model with its peers: when a step begins, and what is done on a loss.

It knows no ROS: the node gives it samples and times, and publishes what it tells.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import Enum

from .model import Model
from .samples import Samples
from .settings import Settings
from .topics import Entry, Topics

Values = Mapping[str, float]


class Phase(Enum):
    """How far the exchange is."""

    WAITING = "waits for the first samples"
    RUNNING = "running"
    LOST = "peers lost"
    ENDED = "ended"


class Exchange:
    """A model between its inputs from the peers and its outputs to them.

    Args:
        model: The model, loaded.
        topics: What is exchanged.
        settings: The settings of the node.
        publish: Gets the values of all outputs once a communication point is reached.
        lost: Gets the reason of a loss, in words.
    """

    def __init__(
        self,
        model: Model,
        topics: Topics,
        settings: Settings,
        publish: Callable[[Values], None],
        lost: Callable[[str], None],
    ) -> None:
        self.model, self._topics, self._settings = model, topics, settings
        self._publish, self._tell_loss = publish, lost
        self._outputs = [*topics.outputs]
        timeout_ns = round(1e9 * settings.timeout)
        self.samples = Samples(
            [topic.name for topic in topics.subscribe],
            settings.misses_tolerated,
            None if settings.in_lockstep else timeout_ns,
        )
        self.phase = Phase.WAITING
        self._last: Values = {}
        """The outputs that were published last."""
        self._safe_inputs = _in_model_units(topics.failsafe, topics.inputs)
        self._safe_outputs = _in_model_units(topics.failsafe, topics.outputs)

    def start(self) -> None:
        """Begin without a sample: as the one that sends first, or that has no inputs."""
        self._begin({})

    def take(self, topic: str, values: Values, now_ns: int) -> None:
        """Take a sample; in lockstep the last one that was missing begins a step."""
        samples = self.samples
        samples.take(topic, values, now_ns)
        if not samples.complete:
            return
        if self.phase is Phase.WAITING or (self.phase is Phase.LOST and self._settings.resume):
            self._begin(samples.values)
        elif self.phase is Phase.RUNNING and self._settings.in_lockstep:
            self.step(now_ns)

    def _begin(self, inputs: Values) -> None:
        self.samples.forget()
        self.model.begin(inputs)
        self.phase = Phase.RUNNING
        self._tell(self.model.read(self._outputs))

    def step(self, now_ns: int) -> None:
        """Do a step with the samples that there are, or go on without the peers."""
        settings = self._settings
        if self.phase is Phase.RUNNING:
            missing = self.samples.begin_step(now_ns)
            if not missing:
                self._advance(self.samples.values)
                return
            self.lose(
                f"no sample of {', '.join(missing)} within {settings.timeout:g} s, "
                f"{settings.misses_tolerated + 1} steps in a row"
            )
        if self.phase is Phase.LOST and settings.on_loss != "stop":
            self._advance(self._safe_inputs if settings.on_loss == "failsafe" else {})

    def _advance(self, inputs: Values) -> None:
        if not self.model.advance(inputs):
            self.phase = Phase.ENDED
        values = self.model.read(self._outputs)
        if self.phase is Phase.LOST and self._settings.on_loss == "failsafe":
            values |= self._safe_outputs
        self._tell(values)

    def _tell(self, values: Values) -> None:
        self._last = values
        self._publish(values)

    def lose(self, reason: str) -> None:
        """Give the peers up."""
        self.samples.lose()
        self.phase = Phase.LOST
        self._tell_loss(reason)

    def failsafe(self) -> Values:
        """The values of all outputs, safe where the file of topics says so; as the node ends."""
        return {**self._last, **self._safe_outputs}


def _in_model_units(failsafe: Values, entries: Mapping[str, Entry]) -> dict[str, float]:
    """The safe values of inputs or outputs, in the units of the model."""
    return {n: entries[n].change(v) for n, v in failsafe.items() if n in entries}
