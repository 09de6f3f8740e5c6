"""Draws docs/hand.svg: the hand closes in Case 1 and in Case 2, moved by two recorded runs; and
docs/three_fingers.svg, two hands of three fingers seen from above.

CSS moves each part from keyframe to keyframe along what was recorded. So the picture is sharp at
any size, moves where a page shows it as an image, and stands still, at the end of the grasp, for
those who want no motion.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from grasp_cosim.grasp.metrics import FINGERS
from grasp_cosim.hand.metrics import directions
from grasp_cosim.recording.result import Result

Part = tuple[str, str]
"""What is drawn, as SVG, and how it moves, as CSS."""

WIDTH, ROW, TOP, MIDDLE = 640, 150, 8, 320
"""px: the picture, the height of a row, above the first one, where x = 0."""
SCALE, THICK, NEWTON = 2200.0, 20, 14.0
"""px: of a m, of a finger, of a N."""
HOLD, RATE = 1.5, 30
"""s that the end is shown, and keyframes in a s."""
SIDE = {1: 1, 2: -1}
"""On which side of the object a finger is."""

STYLE = """
svg { --paper: #fbfbf9; --ink: #1d2023; --muted: #5f656d; --object: #cfcfc8; --lit: #f5b301;
  --finger1: #1f5fa8; --finger2: #c0392b; --on: #fff; }
@media (prefers-color-scheme: dark) { svg { --paper: #15171a; --ink: #e7e6e2; --muted: #979da6;
  --object: #4b5057; --lit: #ffd04d; --finger1: #6ba5e7; --finger2: #ee7b6c; --on: #15171a; } }
text { font: 15px system-ui, "Segoe UI", "Helvetica Neue", "DejaVu Sans", sans-serif;
  fill: var(--ink); }
.name { font-weight: 600; } .muted { fill: var(--muted); } .on { fill: var(--on); }
.end { text-anchor: end; } .middle { text-anchor: middle; }
.rule { stroke: var(--muted); } .target { stroke: var(--ink); stroke-dasharray: 4 4; }
"""


def hand_svg(rows: Sequence[tuple[str, Result]]) -> str:
    """The animation as SVG: a row for each title and its run, all runs of one length.

    A run needs the signals of a grasp, RATE rows a second or more, and both contacts.
    """
    parts = [part for k, (title, run) in enumerate(rows) for part in _row(k, title, run)]
    told = "; ".join(f"{title}: {_outcome(run)}" for title, run in rows)
    return _animation(parts, rows[0][1].time, TOP + ROW * len(rows) + 34, told)


def _animation(
    parts: Sequence[Part], time: npt.NDArray[np.float64], height: int, told: str, more: str = ""
) -> str:
    """Parts above the line of time as SVG, with what it tells in words and `more` style."""
    every = [*parts, *_clock(time, height)]
    drawn = "\n".join(svg for svg, _ in every)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{height}" '
        f'viewBox="0 0 {WIDTH} {height}" role="img" aria-label="{told}">\n'
        f"<style>{STYLE}{more}@media (prefers-reduced-motion: no-preference) {{\n"
        f"{''.join(css for _, css in every)}}}\n</style>\n"
        f'<rect width="{WIDTH}" height="{height}" rx="8" fill="var(--paper)"/>\n'
        f"{drawn}\n</svg>\n"
    )


PLANE, AROUND = 340, 1000.0
"""px: the height of a hand seen from above, and of a m there."""


def three_svg(hands: Sequence[tuple[str, Result]]) -> str:
    """The animation of hands seen from above, beside each other, as SVG; runs of one length.

    The object is a disc of 35 mm.
    """
    parts = [part for k, (title, run) in enumerate(hands) for part in _plane(k, title, run)]
    told, green = "Two hands of three fingers close", "svg { --finger3: #2e8b57; }"
    return _animation(parts, hands[0][1].time, PLANE + 34, told, green)


def _plane(k: int, title: str, run: Result) -> Iterator[Part]:
    """A hand with its title, the times of its contacts and its forces as bars."""
    middle, wrist = WIDTH * (0.25 + 0.5 * k), PLANE / 2 + 14
    signals, time = run.by_role, run.time
    x, y = (float(signals[f"plant.object_position[{i}]"][0]) for i in (1, 2))
    yield (
        f'<text class="name middle" x="{middle:g}" y="22">{title}</text>\n'
        f'<circle cx="{middle + AROUND * x:.1f}" cy="{wrist - AROUND * y:.1f}" '
        f'r="{AROUND * 0.035:.1f}" fill="var(--object)"/>',
        "",
    )
    for j, angle in enumerate(directions(signals), start=1):
        c, s = np.cos(angle), -np.sin(angle)
        turn = f"rotate({np.degrees(np.arctan2(s, c)):.2f})"
        way = AROUND * _face(run, j)
        touch = run.metrics["time_to_contact"][j - 1]
        finger = (
            f'<g transform="{turn}"><rect x="0" y="-10" width="40" height="20" rx="4" '
            f'fill="var(--finger{j})"/></g><text class="on middle" x="{20 * c:.1f}" '
            f'y="{20 * s + 5:.1f}">{j}</text>'
        )
        yield _moved(f"p{k}{j}", finger, time, middle + c * way, y=wrist + s * way)
        out = way[-1] + 68.0
        when = "never touches" if touch is None else f"{touch:.2f} s"
        text = (
            f'<text class="middle" x="{middle + c * out:.1f}" y="{wrist + s * out + 5:.1f}">'
            f"{when}</text>"
        )
        yield _shown(f"w{k}{j}", text, time, float(time[-1]) - 1e-2 if touch is None else touch)


def _row(k: int, title: str, run: Result) -> Iterator[Part]:
    """A hand with its title and what comes of it."""
    top, time = TOP + ROW * k, run.time
    left, right = (_x(_face(run, j) - SIDE[j] * run.by_role[f"plant.gap[{j}]"])[0] for j in (2, 1))
    yield (
        f'<text class="name" x="14" y="{top + 18}">{title}</text>\n'
        f'<line class="rule" x1="14" x2="{WIDTH - 14}" y1="{top + 122}" y2="{top + 122}"/>\n'
        f'<rect x="{left:.1f}" y="{top + 42}" width="{right - left:.1f}" height="80" rx="4" '
        'fill="var(--object)"/>',
        "",
    )
    for j, at in zip(FINGERS, (right, left), strict=True):
        yield from _finger(f"{k}{j}", top, run, at, j)
    target = (
        f'<line class="target" x1="0" x2="0" y1="{top + 38}" y2="{top + 122}"/>'
        f'<text class="muted middle" x="0" y="{top + 34}">target</text>'
    )
    yield _moved(f"t{k}", target, time, _x(run.by_role["controller.target_position"]))
    last = max(run.metrics["time_to_contact"])
    text = f'<text class="name end" x="{WIDTH - 14}" y="{top + 18}">{_outcome(run)}</text>'
    yield _shown(f"o{k}", text, time, last)


def _finger(name: str, top: int, run: Result, at: float, j: int) -> Iterator[Part]:
    """A finger, the light and the time of its contact at px `at`, and the force on it as a bar."""
    side, time, touch = SIDE[j], run.time, run.metrics["time_to_contact"][j - 1]
    lit = f'<rect x="{at - 3:.1f}" y="{top + 34}" width="6" height="88" fill="var(--lit)"/>'
    when = (
        f'<text class="{"" if j == 1 else "end"}" x="{at + 4 * side:.1f}" y="{top + 140}">'
        f"touches at {touch:.2f} s</text>"
    )
    yield _shown(f"l{name}", lit + when, time, touch)
    x = 0 if j == 1 else -THICK
    finger = (
        f'<rect x="{x}" y="{top + 34}" width="{THICK}" height="88" rx="4" '
        f'fill="var(--finger{j})"/>'
        f'<text class="on middle" x="{x + THICK / 2:g}" y="{top + 83}">{j}</text>'
    )
    yield _moved(f"f{name}", finger, time, _x(_face(run, j)))
    force = abs(run.by_role[f"plant.contact_force[{j}]"])
    away = at + side * THICK
    bar = f'<rect x="0" y="{top + 73}" width="1" height="10" fill="var(--ink)"/>'
    yield _moved(f"n{name}", bar, time, 0.0 * time + away, side * NEWTON * force)


def _clock(time: npt.NDArray[np.float64], height: int) -> Iterator[Part]:
    """The time of the runs as a line that a dot goes along."""
    end, y, left, right = float(time[-1]), height - 24, 90, WIDTH - 60
    text = f'<text class="muted" x="14" y="{y + 5}">real time</text>'
    text += f'<text class="muted" x="{right + 14}" y="{y + 5}">{end:g} s</text>'
    yield f'{text}<line class="rule" x1="{left}" x2="{right}" y1="{y}" y2="{y}"/>', ""
    dot = f'<circle cx="0" cy="{y}" r="6" fill="var(--ink)"/>'
    yield _moved("clock", dot, time, left + (right - left) * time / end)


def _moved(
    name: str,
    svg: str,
    time: npt.NDArray[np.float64],
    x: npt.NDArray[np.float64],
    stretch: npt.NDArray[Any] | None = None,
    y: npt.NDArray[np.float64] | None = None,
) -> Part:
    """What is at x px over time in s, and is so many times as long; it stands still at the end.

    With y it is at x, y.
    """
    frames = np.arange(round(float(time[-1]) * RATE) + 1) / RATE
    places = [f"translateX({_number(at)}px)" for at in np.interp(frames, time, x)]
    if y is not None:
        along = zip(np.interp(frames, time, x), np.interp(frames, time, y), strict=True)
        places = [f"translate({_number(a)}px,{_number(b)}px)" for a, b in along]
    if stretch is not None:
        long = np.interp(frames, time, stretch)
        places = [f"{a} scaleX({_number(b)})" for a, b in zip(places, long, strict=True)]
    changes = [  # one in the middle of equal ones says nothing
        i
        for i, place in enumerate(places)
        if not (0 < i < len(places) - 1 and places[i - 1] == place == places[i + 1])
    ]
    keys = [(float(frames[i]), f"transform:{places[i]}") for i in changes]
    drawn = f'<g id="{name}" style="transform:{places[-1]}">{svg}</g>'
    return drawn, _animated(name, keys, float(time[-1]))


def _shown(name: str, svg: str, time: npt.NDArray[np.float64], since: float) -> Part:
    """What is there from a time in s on."""
    keys = [(0.0, "opacity:0"), (since, "opacity:0"), (since + 1e-3, "opacity:1")]
    return f'<g id="{name}">{svg}</g>', _animated(name, keys, float(time[-1]))


def _animated(name: str, keys: Sequence[tuple[float, str]], end: float) -> str:
    """The style that takes an element through its places at times in s, again and again."""
    whole = end + HOLD
    frames = "".join(f"{_number(100.0 * t / whole, 3)}%{{{place}}}" for t, place in keys)
    return (
        f"#{name}{{animation:{name} {whole:g}s linear infinite}}\n"
        f"@keyframes {name}{{{frames}100%{{{keys[-1][1]}}}}}\n"
    )


def _face(run: Result, j: int) -> npt.NDArray[np.float64]:
    """Where the inner face of a finger is, m."""
    return np.asarray(run.by_role[f"plant.position[{j}]"], dtype=np.float64)


def _x(place: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return MIDDLE + SCALE * place


def _number(value: float, digits: int = 1) -> str:
    return f"{round(float(value), digits) + 0.0:g}"


def _outcome(run: Result) -> str:
    return f"{run.metrics['time_difference']:.2f} s apart"
