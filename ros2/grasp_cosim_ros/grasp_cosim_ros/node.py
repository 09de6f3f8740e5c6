"""The lifecycle node: configure loads the model, activate begins the exchange, deactivate ends it
safely. See README.md.
"""

from __future__ import annotations

import signal
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from functools import partial, wraps
from pathlib import Path
from time import sleep
from typing import Any, NamedTuple

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from grasp_cosim import InputError, SimulationError
from rclpy.clock import Clock as RosClock
from rclpy.clock import ClockType, JumpThreshold
from rclpy.duration import Duration
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.time import Time
from rosgraph_msgs.msg import Clock

from .diagnostics import status
from .exchange import Exchange, Phase
from .messages import Encode, decoder, encoder
from .model import Model
from .parameters import ModelParameters, declare, settings_of
from .settings import Settings
from .topics import JOINT_TRAJECTORY, Topic, Topics, read_topics

SUCCESS, FAILURE = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE

LOOK_INTERVAL = 0.05
"""s between two looks whether the peers are there."""

DIAGNOSTICS_INTERVAL = 1.0
"""s."""

MOST_LINES = 100
"""So many different lines, at most, an exchange logs of messages that do not fit."""

LAST_WORDS = 0.5
"""s; so long, at most, the peers have to receive what is sent as the exchange ends."""

LINGER = 0.3
"""s from then on until the publishers go: peers may drop what they have not read of one that went.
"""

INTERNAL_ERROR, INPUT_ERROR, SIMULATION_ERROR = 1, 2, 3
"""Exit codes, as those of the command grasp-cosim."""


class Published(NamedTuple):
    """A topic that is published: its publisher, and what makes its messages."""

    topic: Topic
    publisher: Any
    encode: Encode


Transition = Callable[["FmuNode", Any], TransitionCallbackReturn]


def _in_words(transition: Transition) -> Transition:
    """A transition that says why it fails: ROS does not."""

    @wraps(transition)
    def explained(node: FmuNode, state: Any) -> TransitionCallbackReturn:
        try:
            return transition(node, state)
        except (InputError, SimulationError) as error:
            node.fail(str(error), INPUT_ERROR)
            return FAILURE
        except Exception:
            node.fail(traceback.format_exc(), INTERNAL_ERROR)
            raise

    return explained


class FmuNode(LifecycleNode):  # type: ignore[misc]
    """A model as a node."""

    def __init__(self) -> None:
        super().__init__("grasp_cosim")
        self._steady = RosClock(clock_type=ClockType.STEADY_TIME)
        declare(self)
        self.exit_code: int | None = None
        """Set where the process is to end."""
        self._autostart = bool(self.get_parameter("autostart").value)
        self._model: Model | None = None
        self._exchange: Exchange | None = None
        self._undo: list[Callable[[], None]] = []
        """What deactivation takes back, in this order."""
        self._is_ticking = False
        self._is_simulated = False
        """True where the time is that of /clock."""
        self._published: list[Published] = []
        self._heard: dict[str, Any] = {}
        """The subscriptions, by topic."""
        self._last_reason = ""
        self._logged_lines: set[str] = set()
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_timer(DIAGNOSTICS_INTERVAL, self._tell_status, clock=self._steady)

    # Transitions ------------------------------------------------------------------------------

    @_in_words
    def on_configure(self, state: Any) -> TransitionCallbackReturn:
        """Load the model, check the topics, declare the parameters."""
        self._settings = settings = settings_of(self)
        system = settings.model_system()
        self._topics = read_topics(Path(settings.topics), system)
        self._check(settings, self._topics)
        recorded = bool(settings.out)
        model = Model(system, settings.period or None, settings.stop or None, recorded)
        try:
            self._encoders = {
                t.name: encoder(f"{settings.topics}: publish.{t.name}", t, int(model.period_ns))
                for t in self._topics.publish
            }
            self._decoders = {
                t.name: decoder(f"{settings.topics}: subscribe.{t.name}", t)
                for t in self._topics.subscribe
            }
            self._model_parameters = ModelParameters(self, model, self._topics.inputs)
        except BaseException:
            model.close()
            raise
        self._model = model
        self._period_ns = int(model.period_ns)
        return SUCCESS

    def _check(self, settings: Settings, topics: Topics) -> None:
        """InputError where settings and topics do not fit each other."""
        if settings.in_lockstep and not topics.subscribe:
            raise InputError(
                f"{settings.topics}: subscribe is empty: lockstep has nothing to wait for; must "
                "have a topic, or mode = clock"
            )
        if settings.on_loss == "failsafe" and topics.subscribe and not topics.failsafe:
            raise InputError(
                f"{settings.topics}: failsafe is empty; must have a safe value of a variable, as "
                "on_loss = failsafe"
            )

    @_in_words
    def on_activate(self, state: Any) -> TransitionCallbackReturn:
        """Begin to listen; the model begins with the first samples, or sends the first ones."""
        settings, model = self._settings, self._model
        if model is None:
            return FAILURE
        self._logged_lines.clear()
        self._last_reason = ""
        self._exchange = Exchange(model, self._topics, settings, self._publish, self._lost)
        self._heard.clear()
        self._is_simulated = bool(self.get_parameter("use_sim_time").value)
        for topic in self._topics.subscribe:
            self._listen(topic)
        self._deadline = self._timer(settings.timeout, self._on_deadline)
        self._deadline.cancel()
        self._alone = self._timer(1e-9 * self._period_ns, self._on_alone)
        self._alone.cancel()
        self._looking = self._timer(LOOK_INTERVAL, self._look_for_peers)
        return super().on_activate(state)

    def _listen(self, topic: Topic) -> None:
        """Subscribe to a topic until deactivation."""
        cls, decode = self._decoders[topic.name]
        take = self._taker(topic.name, decode)
        subscription = self.create_subscription(cls, topic.name, take, _qos(topic))
        self._heard[topic.name] = subscription
        self._undo.append(partial(self.destroy_subscription, subscription))

    def _open_publishers(self) -> None:
        """Make the publishers, which live until deactivation.

        In lockstep one side, which sends the first sample, makes them at once; the other one once
        it hears that side. So nothing is sent before both are there to take it.
        """
        if self._settings.publish_clock:
            self._clock_publisher = self.create_publisher(Clock, "/clock", 10)
            self._undo.append(partial(self.destroy_publisher, self._clock_publisher))
        for topic in self._topics.publish:
            cls, encode = self._encoders[topic.name]
            publisher = self.create_publisher(cls, topic.name, _qos(topic))
            self._published.append(Published(topic, publisher, encode))
        self._undo.append(self._close_publishers)

    def _close_publishers(self) -> None:
        for published in self._published:
            published.publisher.wait_for_all_acked(Duration(seconds=LAST_WORDS))
        sleep(LINGER)
        for published in self._published:
            self.destroy_publisher(published.publisher)
        self._published.clear()

    def _timer(self, period: float, callback: Callable[[], None]) -> Any:
        """A timer of the computer's clock that lives until deactivation."""
        timer = self.create_timer(period, self._guarded(callback), clock=self._steady)
        self._undo.append(partial(self.destroy_timer, timer))
        return timer

    @_in_words
    def on_deactivate(self, state: Any) -> TransitionCallbackReturn:
        """End the exchange, with safe outputs."""
        self._end_exchange()
        return super().on_deactivate(state)

    @_in_words
    def on_cleanup(self, state: Any) -> TransitionCallbackReturn:
        """Free the model."""
        self._release()
        return SUCCESS

    @_in_words
    def on_shutdown(self, state: Any) -> TransitionCallbackReturn:
        """End the exchange, with safe outputs, and free the model."""
        self._end_exchange()
        self._release()
        self.exit_code = self.exit_code or 0
        return SUCCESS

    def on_error(self, state: Any) -> TransitionCallbackReturn:
        """After a failure within a transition: end the exchange, and be as at the start."""
        self._end_exchange()
        self._release()
        return SUCCESS

    def _release(self) -> None:
        """Free the model, and take its parameters away."""
        model, self._model = self._model, None
        if model is not None:
            self._model_parameters.remove()
            model.close()

    def _end_exchange(self) -> None:
        """Publish the safe values, stop listening, and keep the result."""
        if self._exchange is None:
            return
        exchange, self._exchange = self._exchange, None
        self._is_ticking = False
        model = exchange.model
        if model.is_begun:
            values = exchange.failsafe()
            for published in self._published:
                if any(entry.name in self._topics.failsafe for entry in published.topic.entries):
                    self._send(published, values)
        while self._undo:
            self._undo.pop()()
        if model.is_begun:
            model.end()
            if self._settings.out:
                model.session.result().save(self._settings.out)
        count = exchange.samples.count
        self.get_logger().info(
            f"{count.steps} steps, {count.misses} missed, {count.late} samples late, "
            f"{count.refused} refused, {count.losses} losses of the peers"
        )

    # The exchange -----------------------------------------------------------------------------

    def _guarded(self, action: Callable[[], None]) -> Callable[[], None]:
        """The action; a model that fails ends the exchange, in one line."""

        def guarded() -> None:
            try:
                action()
            except (InputError, SimulationError) as error:
                self.fail(str(error), SIMULATION_ERROR)
            if self._exchange and self._exchange.phase is Phase.ENDED:
                self.get_logger().info("the stop time was reached")
                self._stop(0)

        return guarded

    def _taker(self, name: str, decode: Callable[[Any], Mapping[str, float]]) -> Any:
        """What takes the messages of a topic."""

        def take(message: Any) -> None:
            exchange = self._exchange
            if exchange is None:
                return
            try:
                values = decode(message)
            except InputError as error:
                exchange.samples.count.refused += 1
                self._tell_error_once(f"{name}: {error}")
                return
            self._guarded(lambda: self._take(exchange, name, values))()

        return take

    def _take(self, exchange: Exchange, name: str, values: Mapping[str, float]) -> None:
        began, steps = exchange.phase, exchange.samples.count.steps
        exchange.take(name, values, self._now_ns())
        if exchange.phase is Phase.RUNNING and began is not Phase.RUNNING:
            self._run()
        elif exchange.samples.count.steps != steps:
            self._deadline.reset()

    def _look_for_peers(self) -> None:
        """Speak once all peers are heard, and send the first sample once all of them listen."""
        exchange, settings = self._exchange, self._settings
        if exchange is None:
            return
        absent = [
            f"a publisher of {name}"
            for name, subscription in self._heard.items()
            if not subscription.get_publisher_count()
        ]
        hears_all = not absent or not settings.in_lockstep
        if not self._published and (hears_all or settings.initiate):
            self._open_publishers()
        absent += [
            f"a subscriber of {published.topic.name}"
            for published in self._published
            if not published.publisher.get_subscription_count()
        ]
        if absent and settings.in_lockstep:
            line = f"waits for {', '.join(absent)}"
            if self._is_new(line):
                self.get_logger().info(line)
            return
        self._looking.cancel()
        begins = settings.initiate or not self._topics.subscribe
        if begins and exchange.phase is Phase.WAITING:
            exchange.start()
            self._run(first=True)

    def _run(self, first: bool = False) -> None:
        """Have steps begin: by the clock, or by the samples, each with its deadline."""
        if self._settings.in_lockstep:
            if not first:  # the peer may take long to begin
                self._deadline.reset()
            return
        self._tick_origin, self._ticks = self._now_ns(), 0
        if self._is_ticking:
            return
        self._is_ticking = True
        if not self._is_simulated:
            self._timer(1e-9 * self._period_ns, self._on_tick)
            return
        any_jump = JumpThreshold(
            min_forward=Duration(nanoseconds=1),
            min_backward=Duration(nanoseconds=-1),
            on_clock_change=False,
        )
        on_jump = self.get_clock().create_jump_callback(any_jump, post_callback=self._on_jump)
        self._undo.append(on_jump.unregister)

    def _on_deadline(self) -> None:
        if self._exchange:
            self._exchange.step(self._now_ns())

    def _on_tick(self) -> None:
        """Do the step that is due, or by a simulated clock all that are."""
        exchange, now = self._exchange, self._now_ns()
        if exchange is None or exchange.phase is Phase.WAITING:
            return
        if not self._tick_origin:  # there was no time on /clock yet
            self._tick_origin = now
        due = (now - self._tick_origin) // self._period_ns - self._ticks
        late = 1e-9 * due * self._period_ns
        if late > self._settings.stall and not self._is_simulated:
            self._loss_by_clock(f"a step began {late:.3g} s late")
            return
        self._ticks += due
        if due > 1 and not self._is_simulated:  # hardware gets no burst of steps
            exchange.samples.count.overruns += due - 1
            due = 1
        for _ in range(due):
            if exchange.phase is Phase.ENDED or self._exchange is None:
                return
            exchange.step(now)

    def _on_jump(self, jump: Any) -> None:
        """The time on /clock has changed: to go on, or as the simulation has begun again."""
        back = -1e-9 * jump.delta.nanoseconds
        if back > 0.0:
            self._loss_by_clock(f"the clock went back by {back:.9g} s")
        else:
            self._guarded(self._on_tick)()

    def _loss_by_clock(self, reason: str) -> None:
        self._tick_origin, self._ticks = self._now_ns(), 0
        if self._exchange and self._exchange.phase is Phase.RUNNING:
            self._exchange.lose(reason)

    def _now_ns(self) -> int:
        clock = self.get_clock() if self._is_simulated else self._steady
        return int(clock.now().nanoseconds)

    def _publish(self, values: Mapping[str, float]) -> None:
        if self._settings.publish_clock:
            self._clock_publisher.publish(Clock(clock=self._stamp()))
        for published in self._published:
            self._send(published, values)

    def _send(self, published: Published, values: Mapping[str, float]) -> None:
        message = published.encode(values)
        begins_at_once = published.topic.type == JOINT_TRAJECTORY
        if hasattr(message, "header") and not begins_at_once:
            message.header.stamp = self._stamp()
        published.publisher.publish(message)

    def _stamp(self) -> Any:
        """The time of the model where it makes the time, else that of the node."""
        makes_time = self._settings.publish_clock or self._settings.in_lockstep
        if makes_time and self._model is not None:
            return Time(nanoseconds=int(self._model.time_ns)).to_msg()
        return self.get_clock().now().to_msg()

    # Losses and failures ----------------------------------------------------------------------

    def _lost(self, reason: str) -> None:
        self._last_reason = reason
        on_loss = self._settings.on_loss
        self.get_logger().error(f"the peers are lost: {reason}: {on_loss}")
        if on_loss == "stop":
            self._stop(SIMULATION_ERROR)
        elif self._settings.in_lockstep:
            self._deadline.cancel()
            self._alone.reset()

    def _on_alone(self) -> None:
        """Go on without the peers, at the pace of the period, until they are back."""
        if self._exchange and self._exchange.phase is Phase.LOST:
            self._exchange.step(self._now_ns())
        else:
            self._alone.cancel()

    def fail(self, reason: str, exit_code: int) -> None:
        """Say why the exchange ends, or does not begin."""
        self._last_reason = reason
        self.get_logger().error(reason)
        if self._exchange is not None:
            self._stop(exit_code)
        elif self._autostart:
            self.exit_code = exit_code

    def _stop(self, exit_code: int) -> None:
        """Deactivate. A process that started itself then ends."""
        self.trigger_deactivate()
        if self._autostart:
            self.exit_code = exit_code

    def _is_new(self, line: str) -> bool:
        """True for a line that was not logged since the activation; of too many the rest is not."""
        if line in self._logged_lines or len(self._logged_lines) >= MOST_LINES:
            return False
        self._logged_lines.add(line)
        return True

    def _tell_error_once(self, line: str) -> None:
        if self._is_new(line):
            self.get_logger().error(line)

    def _tell_status(self) -> None:
        """Publish the diagnostics, and look for peers that speak of something else."""
        exchange = self._exchange
        if exchange and exchange.phase is Phase.WAITING:
            self._tell_other_types()
        message = DiagnosticArray()
        message.header.stamp = self.get_clock().now().to_msg()
        message.status = [status(self.get_fully_qualified_name(), exchange, self._last_reason)]
        self._diagnostics.publish(message)

    def _tell_other_types(self) -> None:
        """Say where a peer has another type on a topic: ROS does not connect them."""
        for topic in self._topics.subscribe:
            for peer in self.get_publishers_info_by_topic(self.resolve_topic_name(topic.name)):
                if peer.topic_type != topic.type:
                    self._last_reason = (
                        f"{topic.name}: {peer.node_name} publishes {peer.topic_type}; must be "
                        f"{topic.type}"
                    )
                    self._tell_error_once(self._last_reason)


def _qos(topic: Topic) -> QoSProfile:
    return QoSProfile(depth=topic.depth, reliability=ReliabilityPolicy[topic.reliability.upper()])


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the node until a signal, or with autostart until its run has ended.

    Args:
        arguments: Those of the command line.

    Returns:
        The exit code.
    """
    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = FmuNode()
    except ParameterException as error:
        print(f"grasp_cosim_ros: {' '.join(str(error).split())}", file=sys.stderr)  # noqa: T201
        rclpy.shutdown()
        return INPUT_ERROR

    def end(*_: object) -> None:
        node.exit_code = node.exit_code or 0

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)
    executor = EventsExecutor()
    executor.add_node(node)
    if node.get_parameter("autostart").value and node.trigger_configure() is SUCCESS:
        node.trigger_activate()
    try:
        while node.exit_code is None:
            executor.spin_once(timeout_sec=0.1)
    except ExternalShutdownException:
        pass
    node.trigger_shutdown()
    executor.shutdown()
    node.destroy_node()
    rclpy.try_shutdown()
    return node.exit_code or 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
