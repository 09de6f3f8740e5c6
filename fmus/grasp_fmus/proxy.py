"""The slave of a proxy: at every step it exchanges its variables with a peer over UDP."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import accumulate, pairwise
from pathlib import Path
from time import monotonic_ns
from typing import Annotated, Any, NamedTuple, get_args, get_type_hints
from weakref import finalize

from .base import INITIALISING, INSTANTIATED, STEPPING, RefusalError, Slave, reported
from .connection import Connection
from .host_log import DISCARD, WARNING
from .link.client import Client
from .link.message import FAILED, LONGEST_STEP, PORT, STRING_SIZE, exposed, read_key
from .link.signature import LinkVariable, Signature
from .variable import TYPES, Scalar, Variable

HOLD, FAILSAFE, STOP = ON_LOSS = ("hold", "failsafe", "stop")
"""The choices of proxy.on_loss, for when the peer is lost."""

NOT_CONNECTED, CONNECTED, MISSING, LOST = range(4)
"""The values of proxy.state."""

MOST = 2**31 - 1
LONGEST_TEXT = 1023
"""Bytes that a text of the settings has at most."""
_NANOSECONDS = 1e9


class Settings(NamedTuple):
    """The parameters proxy.*, but for those of the outputs: type, unit, limits, description."""

    host: Annotated[str, "", None, "name or IPv4 address of the peer"] = "127.0.0.1"
    port: Annotated[int, "", (1, 65535), "its UDP port"] = PORT
    timeout: Annotated[
        float, "s", (1e-6, 3600.0), "longest wait for the outputs of a step, by the clock"
    ] = 0.01  # the step of the original is no measure: 0.1 ms is less than many a network needs
    connect_timeout: Annotated[
        float,
        "s",
        (1e-3, 3600.0),
        "longest wait for an answer in initialisation mode, by the clock",
    ] = 5.0
    misses_tolerated: Annotated[
        int, "", (0, MOST), "misses in a row before the peer is lost with one more"
    ] = 3
    on_loss: Annotated[
        str, "", None, "hold: outputs stay; failsafe: proxy.failsafe.*; stop: fmi2Error"
    ] = STOP
    resume: Annotated[bool, "", None, "go on asking a lost peer, and come back when it answers"] = (
        False
    )
    key_file: Annotated[
        str, "", None, "file with a key shared with the peer, 16 bytes or more; empty: none"
    ] = ""


DEFAULTS = Settings()

_DIAGNOSTICS: Mapping[str, tuple[type[Scalar], str, str]] = {
    "state": (
        int, "", "0 not connected, 1 connected, 2 missing: outputs held, 3 lost: on_loss holds",
    ),
    "missed": (int, "", "steps without an answer in time"),
    "consecutive_missed": (int, "", "of these, those since the last answer in time"),
    "late": (int, "", "answers that came after their step was given up"),
    "out_of_order": (int, "", "of these, those after the answer to a newer step: dropped"),
    "duplicated": (int, "", "answers that had come already"),
    "rejected": (int, "", "datagrams that were malformed, foreign or not authentic"),
    "sessions": (int, "", "sessions begun; more than 1: the peer's model was set up anew"),
    "round_trip_time": (float, "s", "of the newest answer"),
    "age": (
        float, "s",
        "simulation time since that which the outputs belong to; below 0: the peer is ahead",
    ),
}  # fmt: skip
"""Type, unit and description of the outputs proxy.* by their names."""


def own_variables(outputs: Sequence[Variable], settings: Settings = DEFAULTS) -> list[Variable]:
    """Return what a proxy has besides the original: settings, hold, failsafe, diagnostics.

    `outputs` are those of the original; `settings` are start values.
    """
    own = []
    declared = get_type_hints(Settings, include_extras=True).items()
    starts: Sequence[Scalar] = settings
    for (name, hint), start in zip(declared, starts, strict=True):
        kind, unit, limits, text = get_args(hint)
        own.append(Variable(f"proxy.{name}", kind, "parameter", unit, start, "fixed", limits, text))
    for v in outputs:
        text = f"of a lost peer: {v.name} stays as it is"
        name = f"proxy.hold.{v.name}"
        own.append(Variable(name, bool, "parameter", "", False, "fixed", None, text))
    for v in outputs:
        text = f"of a lost peer: value of {v.name}"
        name = f"proxy.failsafe.{v.name}"
        safe = Variable(name, v.kind, "parameter", v.unit, v.kind(), "fixed", None, text)
        own.append(replace(safe, relative=v.relative))
    for name, (kind, unit, text) in _DIAGNOSTICS.items():
        variability = "continuous" if kind is float else "discrete"
        own.append(Variable(f"proxy.{name}", kind, "output", unit, None, variability, None, text))
    return own


def shared_signature(variables: Sequence[Variable]) -> Signature:
    """Return the signature of the variables of an original."""
    shared = ((v.name, TYPES[v.kind], v.causality, v.unit or None) for v in variables)
    return Signature(tuple(LinkVariable(*v) for v in shared))


def bounded(variables: Sequence[Variable], shared: int) -> list[Variable]:
    """Return all variables of a proxy with the limits that its slave checks.

    The first ones, `shared` in number, are the original's: of those texts alone have limits, which
    are what can be sent; the peer checks the rest.
    """
    found = []
    for i, v in enumerate(variables):
        sent = i < shared or v.name.startswith("proxy.failsafe.")
        limits = v.limits if i >= shared else None
        if v.kind is str:
            limits = (0, STRING_SIZE - 1 if sent else LONGEST_TEXT)
        found.append(replace(v, limits=limits))
    return found


def _refused(call: str) -> Callable[..., Any]:
    """Return a function for a call about states, all of which are refused."""

    @reported
    def refuse(self: Slave, *_: Any) -> None:
        raise RefusalError(f"{call}: a proxy has no state, it is the peer's")

    return refuse


class Fmi2Proxy(Slave):
    """A proxy as an FMI 2.0 co-simulation slave; a subclass names the original.

    Values are in the order: inputs, parameters, outputs of the original, then own_variables().
    """

    original: str
    """The file name of the original."""
    variables: tuple[Variable, ...]
    """Those of the original: inputs, parameters, outputs."""
    settings = DEFAULTS
    """The start values of its own parameters."""
    clock: Callable[[], int] = staticmethod(monotonic_ns)

    def _prepare(self) -> None:
        self._signature = exchanged = shared_signature(self.variables)
        outputs = self.variables[len(exchanged.request) :]
        self._variables = bounded(
            [*self.variables, *own_variables(outputs, self.settings)], len(self.variables)
        )
        self._values = [v.kind() if v.start is None else v.start for v in self._variables]
        sizes = (len(exchanged.request), n := len(outputs), len(Settings._fields), n, n)
        self._request, self._outputs, self._settings, self._holds, self._failsafes = _slices(sizes)
        self._diagnostics = slice(self._failsafes.stop, len(self._values))
        self._connection: Connection | None = None
        self._address = ("", 0, "")
        self._state = NOT_CONNECTED
        self._missed = 0
        self._sessions = 1
        self._loss = ""
        self._enter(INSTANTIATED)

    # The life cycle

    @reported
    def enter_initialization_mode(self) -> None:
        """Greet the peer."""
        self._require("fmi2EnterInitializationMode", INSTANTIATED)
        self._connected()
        self._enter(INITIALISING)

    @reported
    def do_step(self, current_time: float, step_size: float) -> bool:
        """Send inputs and parameters, wait for the outputs; without them, hold or lose.

        Returns False, and does nothing, if the step is longer than a peer takes.
        """
        self._check_step(current_time, step_size)
        if step_size > LONGEST_STEP:
            self._log(DISCARD, f"step of {step_size} s: must be at most {LONGEST_STEP:g} s")
            return False
        if self._inputs is None:
            self._refresh()
        settings, connection = self._read_settings(), self._connection
        assert connection is not None  # noqa: S101 - there is one from initialisation on
        if self._state != LOST or settings.resume:
            deadline, anew = self._deadline(settings.timeout), self._state == LOST
            if connection.step(current_time, step_size, self._inputs, deadline, anew):
                self._note_answer(connection)
            else:
                self._note_miss(connection, settings)
        if self._state == LOST and settings.on_loss == STOP:
            self._report(connection)
            raise RefusalError(self._loss)
        self._time = current_time + step_size
        if self._state != LOST:
            self._take(connection)
        self._report(connection)
        return True

    @reported
    def terminate(self) -> None:
        """The end, for the peer as well; values can still be read."""
        self._disconnect()
        super().terminate()

    # State

    _get_fmu_state = _refused("fmi2GetFMUstate")
    _set_fmu_state = _refused("fmi2SetFMUstate")
    state_to_bytes = _refused("fmi2SerializeFMUstate")
    state_from_bytes = _refused("fmi2DeSerializeFMUstate")

    # The peer

    def _refresh(self) -> None:
        """In initialisation mode, exchange values; after that outputs do not follow a set."""
        if self._phase not in (INITIALISING, STEPPING) or self._inputs is not None:
            return
        inputs = self._values[self._request]
        if self._phase == INITIALISING:
            connection, settings = self._connected(), self._read_settings()
            deadline = self._deadline(settings.connect_timeout)
            if not connection.initialise(self._time, inputs, deadline):
                self._give_up(connection, settings)
            self._take(connection)
        self._inputs = inputs

    def _connected(self) -> Connection:
        """Return the connection with a session to the peer of the settings, or RefusalError."""
        settings = self._read_settings()
        address = (settings.host, settings.port, settings.key_file)
        if self._connection is not None and self._address == address:
            return self._connection
        self._disconnect()
        client = Client(self._signature, self._key(settings.key_file))
        deadline = self._deadline(settings.connect_timeout)
        try:
            connection = Connection(settings.host, settings.port, client, deadline, self.clock)
        except OSError as error:
            reason = error.strerror or error
            raise RefusalError(f"{_peer(settings)}: no connection: {reason}") from error
        self._connection, self._address = connection, address
        self._close = finalize(self, connection.close)
        if not connection.greet(deadline):
            self._give_up(connection, settings)
        self._values[self._diagnostics.start] = self._state = CONNECTED
        return connection

    def _key(self, file: str) -> bytes | None:
        """Return the shared key in a file, None without a file; RefusalError where it is invalid.

        It is logged where others can read it.
        """
        try:
            key = read_key(Path(file)) if file else None
            if key and (said := exposed(Path(file))):
                self._log(WARNING, said)
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", error)
            raise RefusalError(f"proxy.key_file = {file!r}: {reason}") from error
        return key

    def _deadline(self, timeout: float) -> int:
        return self.clock() + round(timeout * _NANOSECONDS)

    def _disconnect(self) -> None:
        if self._connection is not None:
            self._close()
            self._connection = None
            self._values[self._diagnostics.start] = self._state = NOT_CONNECTED

    def _give_up(self, connection: Connection, settings: Settings) -> None:
        """Raise RefusalError with the reason why initialisation failed; the host may try again."""
        self._disconnect()
        if connection.refusal:
            raise RefusalError(f"{_peer(settings)}: {connection.refusal.text}")
        raise RefusalError(
            f"no answer from {_peer(settings)} within {settings.connect_timeout:g} s"
            f"{connection.trouble}: is the peer running there, and has it "
            f"{'the same' if settings.key_file else 'no'} key? "
            f"e.g. grasp-cosim serve {self.original} --port {settings.port}"
        )

    def _note_answer(self, connection: Connection) -> None:
        if self._state == LOST:
            text = f"{_peer(self._read_settings())}: the peer answers again"
            if connection.sessions > self._sessions:
                text += " in a new session, its model set up anew"
            self._log(WARNING, text)
        self._sessions = connection.sessions
        self._state, self._missed = CONNECTED, 0

    def _note_miss(self, connection: Connection, settings: Settings) -> None:
        self._missed += 1
        failed = connection.refusal is not None and connection.refusal.code == FAILED
        if self._state != LOST:
            self._state = MISSING
            if failed or self._missed > settings.misses_tolerated:
                self._lose(connection, settings)

    def _lose(self, connection: Connection, settings: Settings) -> None:
        self._state = LOST
        reason = f"no answer within {settings.timeout:g} s{connection.trouble}"
        if connection.refusal:
            reason = connection.refusal.text
        self._loss = f"{_peer(settings)} is lost, {self._missed} missed in a row: {reason}"
        if settings.on_loss == STOP:
            return
        self._log(WARNING, f"{self._loss}; proxy.on_loss = {settings.on_loss}")
        self._take(connection)
        if settings.on_loss == FAILSAFE:
            places = (self._outputs, self._holds, self._failsafes)
            each = zip(*(self._values[place] for place in places), strict=True)
            self._values[self._outputs] = [now if hold else safe for now, hold, safe in each]

    # Values

    def _read_settings(self) -> Settings:
        """Return the settings now; RefusalError where one is invalid."""
        if self._params is None:
            settings = Settings(*self._values[self._settings])
            if settings.on_loss not in ON_LOSS:
                raise RefusalError(
                    f"proxy.on_loss = {settings.on_loss!r}: must be {', '.join(ON_LOSS)}"
                )
            self._params = settings
        return self._params  # type: ignore[no-any-return]  # a block's are of any type

    def _take(self, connection: Connection) -> None:
        outputs = connection.client.outputs
        assert outputs is not None  # noqa: S101 - there are some from initialisation on
        self._values[self._outputs] = outputs

    def _report(self, connection: Connection) -> None:
        """Bring the diagnostics up to date; before the first step they would not settle."""
        client = connection.client
        c = client.counters
        counts = (
            self._state, c.missed, self._missed, c.late, c.out_of_order, c.duplicated, c.rejected,
            connection.sessions,
        )  # fmt: skip
        times = (client.round_trip / _NANOSECONDS, self._time - client.outputs_time)
        self._values[self._diagnostics] = [*(min(count, MOST) for count in counts), *times]


def _slices(sizes: Sequence[int]) -> list[slice]:
    """Return consecutive slices of a list, of these sizes."""
    return [slice(*pair) for pair in pairwise(accumulate(sizes, initial=0))]


def _peer(settings: Settings) -> str:
    return f"{settings.host}:{settings.port}"
