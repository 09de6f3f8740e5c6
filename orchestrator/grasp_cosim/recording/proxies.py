"""The proxies of a run, from the diagnostics that they put out at every step."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from ..base.text import counted

Signals = Mapping[str, npt.NDArray[Any]]
Times = npt.NDArray[np.float64]

STATE = ".proxy.state"
LOST, BACK = 3, 4
"""The values of proxy.state while the peer is lost, and once it answers again."""

COUNTS = (
    *("missed", "late", "out_of_order", "duplicated", "rejected"),
    *("trips", "limited", "implausible"),
)

NEEDED = (*COUNTS, "sessions", "consecutive_missed", "round_trip_time", "age", "lead")
"""The diagnostics that figures are made of, next to the state."""

MAX_LISTED_LOSSES, MAX_STEPS_AHEAD = 5, 10
"""The most losses that are named; steps that a peer's clock may be ahead without a word."""


def of_proxies(names: Iterable[object]) -> frozenset[str]:
    """Those of the names of signals that are diagnostics of a proxy."""
    return frozenset(str(name) for name in names if ".proxy." in str(name))


def proxy_figures(time: Times, signals: Signals) -> dict[str, dict[str, Any]]:
    """The figures of each proxy of which all diagnostics are there: counts in all, times in s.

    lost and back are the communication points at which the peer was lost, and answered again; ahead
    is the most that its outputs were from the future. lead is the most that an answer in time was
    ahead of its step, or behind.
    """
    names = [
        name
        for name in (signal.removesuffix(STATE) for signal in signals if signal.endswith(STATE))
        if all(f"{name}.proxy.{needed}" in signals for needed in NEEDED)
    ]
    return {name: _figures(time, signals, f"{name}.proxy.") for name in names if len(time)}


def proxy_lines(time: Times, signals: Signals, step: float) -> list[str]:
    """Remarks on the proxies, a line each; step is the run's, in s."""
    lines = []
    for name, figures in proxy_figures(time, signals).items():
        steps = round(float(time[-1] - time[0]) / step)  # of which not each need be recorded
        lines += [f"{name}: {line}" for line in _lines(figures, steps, step)]
    return lines


def _figures(time: Times, signals: Signals, prefix: str) -> dict[str, Any]:
    """The figures of the proxy whose diagnostics have names with that prefix."""
    diagnostics = {
        name.removeprefix(prefix): column
        for name, column in signals.items()
        if name.startswith(prefix)
    }
    figures: dict[str, Any] = {name: _total(diagnostics[name]) for name in COUNTS}
    is_lost = diagnostics["state"] >= LOST
    turns = np.diff(is_lost.astype(np.int8), prepend=0)  # 1 at a loss, -1 where it is back
    # a proxy that is initialised again, as one whose peer is back, begins at session 1 again
    figures["sessions"] = int(diagnostics["sessions"].max()) + int((turns < 0).sum())
    figures["most_in_a_row"] = int(diagnostics["consecutive_missed"].max())
    figures["round_trip_median"] = float(np.median(diagnostics["round_trip_time"]))
    figures["round_trip_worst"] = float(diagnostics["round_trip_time"].max())
    figures["ahead"] = max(0.0, -float(diagnostics["age"].min()))
    figures["lead"] = float(np.abs(diagnostics["lead"]).max())
    figures["lost"] = time[turns > 0].tolist()
    figures["back"] = time[turns < 0].tolist()
    return figures


def _total(counter: npt.NDArray[Any]) -> int:
    """What a counter came to, which begins again with the loop."""
    counts = counter.astype(np.int64)
    previous = np.append(0, counts[:-1])
    increments = np.where(counts < previous, counts, counts - previous)
    return int(increments.sum())


def _lines(figures: Mapping[str, Any], steps: int, step: float) -> Iterator[str]:
    """The remarks on a proxy in a run of so many steps of `step` in s."""
    for moment in figures["lost"][:MAX_LISTED_LOSSES]:
        yield _loss(moment, figures["back"])
    if figures["sessions"] > 1:
        yield (
            "the peer was started again, and its model set up from the start: "
            f"{figures['sessions']} sessions in this run"
        )
    if figures["trips"]:
        yield f"the peer put itself into its safe state {counted(figures['trips'], 'time')}"
    if figures["limited"]:
        yield f"{counted(figures['limited'], 'command')} beyond the limits of the proxy: clamped"
    if figures["implausible"]:
        yield f"{counted(figures['implausible'], 'answer')} dropped that cannot have been measured"
    if figures["ahead"] > MAX_STEPS_AHEAD * step:
        yield (
            f"the peer's clock was up to {figures['ahead']:.3g} s ahead of the run, which did not "
            "keep up"
        )
    yield (
        f"{figures['missed']} of {steps} steps missed ({figures['most_in_a_row']} in a row), "
        f"{figures['late']} answers late; "
        f"round trip {1e3 * figures['round_trip_median']:.3g} ms, "
        f"at worst {1e3 * figures['round_trip_worst']:.3g} ms"
    )


def _loss(moment: float, returns: Iterable[float]) -> str:
    """The remark on a peer that was lost at a moment; `returns` are when it was back, all in s."""
    back = next((time for time in returns if time > moment), None)
    lost = f"the peer was lost at t = {moment:.9g} s and "
    if back is None:
        return (
            f"{lost}did not come back; its outputs were meanwhile as proxy.on_loss says, and "
            "with proxy.resume = true it may come back"
        )
    return f"{lost}came back at t = {back:.9g} s; its outputs were meanwhile as proxy.on_loss says"
