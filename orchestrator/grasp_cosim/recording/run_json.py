"""run.json: what stands in it, and the checks of one that is read.

It has a run's settings (system/settings.py), its figures, as "measured" its metrics, and what is
known of its signals. Every entry is checked before anything is made of it, down to the last one.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Required, TypedDict

from ..base.checks import is_number, is_value, known
from ..base.errors import InputError
from ..base.typed_json import Decoder, Valid, json_in
from ..system.stimuli import RecordedConnection
from ..system.times import LONGEST, NANOSECONDS

MAX_FLOAT = 1.7976931348623157e308
"""The largest number that is finite as a float64; JSON has larger integers, and Infinity."""


def _is_finite(value: Any) -> bool:
    return is_number(value) and abs(value) <= MAX_FLOAT


def _is_count(value: Any) -> bool:
    return is_number(value) and isinstance(value, int) and 0 <= value < 2**63


def _is_time(value: Any) -> bool:
    return _is_finite(value) and abs(value) <= LONGEST


def _is_step(value: Any) -> bool:
    return _is_time(value) and value * NANOSECONDS >= 1.0


def _is_logging(value: Any) -> bool:
    categories = value if isinstance(value, list) else []
    return isinstance(value, bool) or (
        bool(categories) and all(isinstance(category, str) for category in categories)
    )


def _is_metric(value: Any) -> bool:
    values = value if isinstance(value, list) else [value]
    return all(v is None or isinstance(v, bool) or _is_finite(v) for v in values)


Number = Annotated[float, Valid("a number", _is_finite)]
Count = Annotated[int, Valid("a whole number, at least 0", _is_count)]
TimeInS = Annotated[float, Valid(f"a number from -{LONGEST:g} to {LONGEST:g}", _is_time)]
StepInS = Annotated[float, Valid("a number greater than 0, at least 1e-09", _is_step)]
Value = Annotated[Any, Valid("a number, boolean or string, or a list of such", is_value)]
Setting = Annotated[Any, Valid("a number, boolean or string", is_value)]
Categories = Annotated[bool | list[str], Valid("true or a list of strings", _is_logging)]
MetricValue = Annotated[Any, Valid("a number, a boolean or null, or a list of such", _is_metric)]


class SolverEntry(TypedDict):
    """The tolerance of a solver; further ones may stand next to it."""

    relative_tolerance: Number


class ComponentEntry(TypedDict, total=False):
    """A component."""

    fmu: Required[str]
    values: Required[Mapping[str, Value]]
    step: Required[Number | None]
    isolation: Required[str]
    rename: Required[Mapping[str, str]]
    units: Mapping[str, str]
    solver: SolverEntry
    tolerance: Number
    logging: Categories


class EventEntry(TypedDict, total=False):
    """An event, and when it is."""

    set: Required[Mapping[str, Value]]
    at: Number
    when: str


FaultEntry = TypedDict(
    "FaultEntry",
    {
        "connection": Required[str],
        "kind": Required[str],
        "from": Number,
        "until": Number,
        "when": str,
        "seed": Number,
    },
    total=False,
)
"""A fault, and when it is; the parameters of its kind stand next to these."""


SpreadEntry = TypedDict(
    "SpreadEntry",
    {"median": TimeInS, "p99": TimeInS, "p99.9": TimeInS, "worst": TimeInS, "worst_at": TimeInS},
)
"""How long a part of the steps took, in s: realtime.timing.SPREAD_KEYS."""


class OverrunEntry(TypedDict):
    """A step that was late, and what took so long."""

    step: Count
    time: TimeInS
    late: TimeInS
    culprit: str
    took: TimeInS


class OverrunsEntry(TypedDict):
    """The steps that were late."""

    count: Count
    culprits: Mapping[str, Count]
    listed: list[OverrunEntry]


class HistogramEntry(TypedDict):
    """How many steps took how long, between edges in s."""

    edges: list[TimeInS]
    counts: list[Count]


class TimingEntry(TypedDict):
    """The timing of a run by the clock: realtime.timing.Timing."""

    factor: Number
    period: TimeInS
    overrun: str
    granted: list[str]
    refused: list[str]
    steps: Count
    real_time_factor: Number
    overruns: OverrunsEntry
    parts: Mapping[str, SpreadEntry]
    histograms: Mapping[str, HistogramEntry]


class LimitEntry(TypedDict):
    """A limit of the system."""

    when: str
    then: str


class TriggerEntry(TypedDict):
    """When the run is recorded: system.record.Trigger."""

    when: str
    before: TimeInS
    after: TimeInS


class BoundsEntry(TypedDict, total=False):
    """The limits of a metric: system.parts.MetricLimit."""

    low: Number | None
    high: Number | None


class AcceptanceEntry(TypedDict, total=False):
    """What the run may come to and still pass: system.parts.Acceptance."""

    lost: Number
    missed: Number
    implausible: Number
    trips: Number
    limited: Number
    lead: Number
    initialised_anew: Number
    overruns: Number
    refused: Number
    warnings: Number
    unfinished: Number
    metrics: Mapping[str, BoundsEntry]


class Made(TypedDict):
    """How the run was made."""

    system: str
    scheme: str
    step: StepInS
    stop: TimeInS
    initialisation: Mapping[str, Value]
    components: Mapping[str, ComponentEntry]
    connections: list[RecordedConnection]
    events: list[EventEntry]
    faults: list[FaultEntry]


class MadeBeside(TypedDict, total=False):
    """How it was made, in entries that may be missing."""

    roles: Mapping[str, str]
    input: Mapping[str, str]
    changed: Mapping[str, Value]
    metrics: list[str]
    diverging: str
    start: TimeInS
    record: list[str]
    trigger: TriggerEntry
    realtime: Mapping[str, Setting | None]
    limits: list[LimitEntry]
    acceptance: AcceptanceEntry
    steered: bool


class FmuEntry(TypedDict, total=False):
    """Which FMU a component was."""

    guid: str
    tool: str | None
    native_twin_of: str
    sha256: str | None
    path: str


class Origin(TypedDict, total=False):
    """When the run was made, and with what; all of it may be missing."""

    title: str
    date: str
    versions: Mapping[str, str]
    fmus: Mapping[str, FmuEntry]
    input_path: str
    command: list[str]


class RejectionEntry(TypedDict):
    """How often a component took no step of the length asked for, and when first, in s."""

    count: Count
    first: Number


class OfTheRun(TypedDict):
    """What came out."""

    complete: bool
    wall_time: Number | None
    steps: Count
    rows: Count
    measured: Mapping[str, MetricValue]
    log: list[str]
    rejections: Mapping[str, RejectionEntry]
    units: Mapping[str, str | None]


class ToSiEntry(TypedDict):
    """A value in SI is factor * value + offset."""

    factor: Number
    offset: Number


class ExceededEntry(TypedDict):
    """A limit that was exceeded: first when, in s, with which value, and in how many steps."""

    limit: str
    then: str
    first: Number
    value: Number
    steps: Count


class WindowEntry(TypedDict):
    """Which window of a triggered run it is: exchange.listener.Window."""

    number: Count
    time: TimeInS
    times: Count
    complete: bool


class Beside(TypedDict, total=False):
    """More that is known of it; all of it may be missing."""

    metric_units: Mapping[str, str | None]
    missing_metrics: list[str]
    types: Mapping[str, str]
    descriptions: Mapping[str, str]
    to_si: Mapping[str, ToSiEntry]
    proxies: Mapping[str, Mapping[str, Any]]
    ended_at: Number
    timing: TimingEntry
    exceeded: list[ExceededEntry]
    initialised_anew: list[Number]
    peers: Mapping[str, Mapping[str, str]]
    verdict: list[Mapping[str, Any]]
    window: WindowEntry
    windows: list[Mapping[str, Any]]


class RunJson(Made, MadeBeside, Origin, OfTheRun, Beside):
    """All of run.json."""


MADE, MADE_BESIDE = tuple(Made.__annotations__), tuple(MadeBeside.__annotations__)
ORIGIN = tuple(Origin.__annotations__)
"""The names of these entries."""


_DECODER = Decoder()


def read_run_json(path: Path) -> RunJson:
    """The object in a run.json; InputError at the first entry that is not as it must be."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise unreadable(path, error) from error
    content = json_in(str(path), data)
    if not isinstance(content, dict):
        raise InputError(f"{path}: is {type(content).__name__}; must be a JSON object")
    for key in (*Made.__annotations__, *OfTheRun.__annotations__):
        if key not in content:
            raise InputError(
                f"{path}: no entry {key!r}; must have one, as `grasp-cosim run --out` writes it"
            )
    run = _DECODER.decoded(RunJson, str(path), content)
    for number, connection in enumerate(run["connections"]):
        for end, port in (("from", connection["from"]), ("to", connection["to"])):
            component = port.partition(".")[0]
            place = f"{path}: connections[{number}]: {end} = {port!r}: no component"
            known(place, component, run["components"])
    return run


def unreadable(path: Path, error: OSError) -> InputError:
    """The error for a file of a run that cannot be read."""
    return InputError(
        f"{path}: {error.strerror}; must be a folder that `grasp-cosim run --out` wrote"
    )
