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
"""The diagnostics that figures are made of, beside the state."""

LISTED, AHEAD = 5, 10
"""The most losses that are named; steps that a peer's clock may be ahead without a word."""


def of_proxies(names: Iterable[object]) -> frozenset[str]:
    """Those of the names of signals that are diagnostics of a proxy."""
    return frozenset(str(name) for name in names if ".proxy." in str(name))


def proxy_figures(time: Times, signals: Signals) -> dict[str, dict[str, Any]]:
    """The figures of each proxy of which all diagnostics are there: counts in all, times in s.

    lost and back are the communication points at which the peer was lost, and answered again;
    ahead is how far its outputs were from the future at most, lead by how much an answer in time
    was ahead of its step, or behind.
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


def _figures(time: Times, signals: Signals, start: str) -> dict[str, Any]:
    own = {key.removeprefix(start): v for key, v in signals.items() if key.startswith(start)}
    lost = own["state"] >= LOST
    turns = np.diff(lost.astype(np.int8), prepend=0)
    return {
        **{name: _counted(own[name]) for name in COUNTS},
        # a proxy that is initialised anew, as one whose peer is back, begins at 1 again
        "sessions": int(own["sessions"].max()) + int((turns < 0).sum()),
        "most_in_a_row": int(own["consecutive_missed"].max()),
        "round_trip_median": float(np.median(own["round_trip_time"])),
        "round_trip_worst": float(own["round_trip_time"].max()),
        "ahead": max(0.0, -float(own["age"].min())),
        "lead": float(np.abs(own["lead"]).max()),
        "lost": time[turns > 0].tolist(),
        "back": time[turns < 0].tolist(),
    }


def _counted(counter: npt.NDArray[Any]) -> int:
    """What a counter came to, which begins anew with the loop."""
    whole = counter.astype(np.int64)
    before = np.append(0, whole[:-1])
    return int(np.where(whole < before, whole, whole - before).sum())


def _lines(f: Mapping[str, Any], steps: int, step: float) -> Iterator[str]:
    for moment in f["lost"][:LISTED]:
        back = next((t for t in f["back"] if t > moment), None)
        said = f"the peer was lost at t = {moment:.9g} s and "
        if back is None:
            yield (
                f"{said}did not come back; its outputs were meanwhile as proxy.on_loss says, and "
                "with proxy.resume = true it may come back"
            )
        else:
            yield (
                f"{said}came back at t = {back:.9g} s; its outputs were meanwhile as "
                "proxy.on_loss says"
            )
    if f["sessions"] > 1:
        yield (
            f"the peer was started anew, and its model set up from the start: {f['sessions']} "
            "sessions in this run"
        )
    if f["trips"]:
        yield f"the peer put itself into its safe state {counted(f['trips'], 'time')}"
    if f["limited"]:
        yield f"{counted(f['limited'], 'command')} beyond the limits of the proxy: clamped"
    if f["implausible"]:
        yield f"{counted(f['implausible'], 'answer')} dropped that cannot have been measured"
    if f["ahead"] > AHEAD * step:
        yield (
            f"the peer's clock was up to {f['ahead']:.3g} s ahead of the run, which did not keep up"
        )
    yield (
        f"{f['missed']} of {steps} steps missed ({f['most_in_a_row']} in a row), {f['late']} "
        f"answers late; round trip {1e3 * f['round_trip_median']:.3g} ms, at worst "
        f"{1e3 * f['round_trip_worst']:.3g} ms"
    )
