"""Draws docs/hand.svg: the hand closes in Case 1 and in Case 2, moved by two recorded runs;
docs/three_fingers.svg, two hands of three fingers seen from above; and docs/tandem.svg, a gripper
on an arm whose wrist stays, and one whose wrist goes to the middle.

CSS moves each part from keyframe to keyframe along what was recorded. So the picture is sharp at
any size, and moves on a page that shows it as an image. It stands still at the end of the grasp for
readers who want no motion.
"""

from collections.abc import Iterator, Mapping, Sequence
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
    """The animation of hands seen from above, next to each other, as SVG; runs of one length.

    The object is a disc of 35 mm.
    """
    parts = [part for k, (title, run) in enumerate(hands) for part in _plane(k, title, run)]
    told, green = "Two hands of three fingers close", "svg { --finger3: #2e8b57; }"
    return _animation(parts, hands[0][1].time, PLANE + 34, told, green)


def _plane(k: int, title: str, run: Result) -> Iterator[Part]:
    """A hand with its title, and its fingers with the times of their contacts."""
    middle, wrist = WIDTH * (0.25 + 0.5 * k), PLANE / 2 + 14
    signals, time = run.by_role, run.time
    x, y = (float(signals[f"plant.object_position[{i}]"][0]) for i in (1, 2))
    yield (
        _text(middle, 22, title, "name middle")
        + f'<circle cx="{middle + AROUND * x:.1f}" cy="{wrist - AROUND * y:.1f}" '
        f'r="{AROUND * 0.035:.1f}" fill="var(--object)"/>',
        "",
    )
    for j, angle in enumerate(directions(signals), start=1):
        c, s = np.cos(angle), -np.sin(angle)
        way = AROUND * signals[f"plant.position[{j}]"]
        finger = (
            f'<g transform="rotate({np.degrees(np.arctan2(s, c)):.2f})">{_rect(0, -10, 40, 20, j)}'
            f"</g>{_text(20 * c, 20 * s + 5, str(j), 'on middle')}"
        )
        yield _moved(f"p{k}{j}", finger, time, middle + c * way, wrist + s * way)
        out = way[-1] + 68.0
        touch = _touches(run)[j - 1]
        when = "never touches" if touch is None else f"{touch:.2f} s"
        text = _text(middle + c * out, wrist + s * out + 5, when, "middle")
        yield _shown(f"w{k}{j}", text, time, float(time[-1]) - 1e-2 if touch is None else touch)


BESIDE, LOWER, BEAM, NARROW = 1080.0, 216, 46, 16
"""px: of a m of two grippers next to each other, the height of their picture, where a beam is, and
of a finger.
"""


def tandem_svg(grippers: Sequence[tuple[str, Result]]) -> str:
    """The animation of grippers in tandem next to each other, as SVG; runs of one length.

    A run needs the signals of a grasp and those of the wrist, RATE rows a second or more.
    """
    parts = [part for k, (title, run) in enumerate(grippers) for part in _gripper(k, title, run)]
    told = "; ".join(f"{title}: {_carried(run)}" for title, run in grippers)
    return _animation(parts, grippers[0][1].time, LOWER + 34, told)


def _gripper(k: int, title: str, run: Result) -> Iterator[Part]:
    """A gripper on its arm with its title, its box, and what becomes of that."""
    signals, time, floor = run.by_role, run.time, BEAM + 118
    centre = WIDTH * (0.25 + 0.5 * k) - 18
    place = {j: centre + BESIDE * signals[f"plant.position[{j}]"] for j in FINGERS}
    wrist = centre + BESIDE * signals["plant.wrist_position"]
    left, right = WIDTH * 0.5 * k + 14, WIDTH * 0.5 * (k + 1) - 14
    yield (
        _text(left, 22, title, "name")
        + f'<line class="rule" x1="{left}" x2="{right}" y1="{floor}" y2="{floor}"/>',
        "",
    )
    faces = {
        j: signals[f"plant.position[{j}]"][0] - SIDE[j] * signals[f"plant.gap[{j}]"][0]
        for j in FINGERS
    }
    width = BESIDE * float(faces[1] - faces[2])
    box = (
        f'<rect x="{-width / 2:.1f}" y="{floor - 78}" width="{width:.1f}" height="78" rx="3" '
        'fill="var(--object)"/>'
    )
    yield _moved(f"b{k}", box, time, centre + BESIDE * signals["plant.object_position"])
    arm = f'<rect x="-10" y="{BEAM - 16}" width="20" height="16" fill="var(--muted)"/>'
    yield _moved(f"a{k}", arm, time, wrist)
    beam = f'<rect x="0" y="{BEAM}" width="1" height="9" fill="var(--muted)"/>'
    spread = place[1] - place[2] + 2 * NARROW
    yield _moved(f"c{k}", beam, time, place[2] - NARROW, stretch=spread)
    for j, touch in zip(FINGERS, _touches(run), strict=True):
        x = 0 if j == 1 else -NARROW
        number = _text(x + NARROW / 2, BEAM + 62, str(j), "on middle")
        finger = _rect(x, BEAM + 9, NARROW, 102, j) + number
        yield _moved(f"g{k}{j}", finger, time, place[j])
        when = "never" if touch is None else f"{touch:.2f} s"
        label = _text(place[j][-1], floor + 20, when, "" if j == 1 else "end")
        yield _shown(f"w{k}{j}", label, time, float(time[-1]) - 1e-2 if touch is None else touch)
    outcome = _text(left, LOWER - 8, _carried(run), "")
    yield _shown(f"q{k}", outcome, time, float(time[-1]) - 0.5)


def _touches(run: Result) -> Any:
    """When the fingers touch, s; None for one that does not."""
    return run.metrics["time_to_contact"]


def _carried(run: Result) -> str:
    metrics: Mapping[str, Any] = run.metrics
    shift, apart = 1e3 * metrics["object_shift"], metrics["time_difference"]
    touched = "one never touches" if apart is None else f"{apart:.2f} s apart"
    return f"{touched}, box carried {shift:.1f} mm"


def _row(k: int, title: str, run: Result) -> Iterator[Part]:
    """A hand with its title and what comes of it."""
    top, time, signals = TOP + ROW * k, run.time, run.by_role
    faces = {j: MIDDLE + SCALE * signals[f"plant.position[{j}]"] for j in FINGERS}
    ends = {j: faces[j][0] - SIDE[j] * SCALE * signals[f"plant.gap[{j}]"][0] for j in FINGERS}
    yield (
        _text(14, top + 18, title, "name")
        + f'<line class="rule" x1="14" x2="{WIDTH - 14}" y1="{top + 122}" y2="{top + 122}"/>'
        f'<rect x="{ends[2]:.1f}" y="{top + 42}" width="{ends[1] - ends[2]:.1f}" height="80" '
        'rx="4" fill="var(--object)"/>',
        "",
    )
    for j, touch in zip(FINGERS, _touches(run), strict=True):
        at, side, anchor = ends[j], SIDE[j], "" if j == 1 else "end"
        lit = f'<rect x="{at - 3:.1f}" y="{top + 34}" width="6" height="88" fill="var(--lit)"/>'
        when = _text(at + 4 * side, top + 140, f"touches at {touch:.2f} s", anchor)
        yield _shown(f"l{k}{j}", lit + when, time, touch)
        x = 0 if j == 1 else -THICK
        finger = _rect(x, top + 34, THICK, 88, j) + _text(x + 10, top + 83, str(j), "on middle")
        yield _moved(f"f{k}{j}", finger, time, faces[j])
        force = abs(signals[f"plant.contact_force[{j}]"])
        bar = f'<rect x="0" y="{top + 73}" width="1" height="10" fill="var(--ink)"/>'
        yield _moved(f"n{k}{j}", bar, time, at + side * THICK, stretch=side * NEWTON * force)
    target = f'<line class="target" x1="0" x2="0" y1="{top + 38}" y2="{top + 122}"/>'
    target += _text(0, top + 34, "target", "muted middle")
    yield _moved(f"t{k}", target, time, MIDDLE + SCALE * signals["controller.target_position"])
    text = _text(WIDTH - 14, top + 18, _outcome(run), "name end")
    yield _shown(f"o{k}", text, time, max(_touches(run)))


def _clock(time: npt.NDArray[np.float64], height: int) -> Iterator[Part]:
    """The time of the runs as a line that a dot goes along."""
    end, y, left, right = float(time[-1]), height - 24, 90, WIDTH - 60
    text = _text(14, y + 5, "real time", "muted") + _text(right + 14, y + 5, f"{end:g} s", "muted")
    yield f'{text}<line class="rule" x1="{left}" x2="{right}" y1="{y}" y2="{y}"/>', ""
    dot = f'<circle cx="0" cy="{y}" r="6" fill="var(--ink)"/>'
    yield _moved("clock", dot, time, left + (right - left) * time / end)


def _text(x: float, y: float, text: str, kind: str) -> str:
    return f'<text class="{kind}" x="{x:.1f}" y="{y:.1f}">{text}</text>'


def _rect(x: float, y: float, width: float, height: float, finger: int) -> str:
    size = f'x="{x}" y="{y}" width="{width}" height="{height}"'
    return f'<rect {size} rx="4" fill="var(--finger{finger})"/>'


def _moved(
    name: str,
    svg: str,
    time: npt.NDArray[np.float64],
    x: npt.ArrayLike,
    y: npt.ArrayLike = 0.0,
    stretch: npt.ArrayLike | None = None,
) -> Part:
    """What is at x, y in px over time in s, and is so many times as long; it stops at the end."""
    frames = np.arange(round(float(time[-1]) * RATE) + 1) / RATE
    form = "translate({}px,{}px)" + ("" if stretch is None else " scaleX({})")
    each = [np.broadcast_to(v, time.shape) for v in (x, y, stretch) if v is not None]
    rows = zip(*(np.interp(frames, time, v) for v in each), strict=True)
    places = [form.format(*map(_number, row)) for row in rows]
    keys = [  # one in the middle of equal ones says nothing
        (float(frames[i]), f"transform:{place}")
        for i, place in enumerate(places)
        if not (0 < i < len(places) - 1 and places[i - 1] == place == places[i + 1])
    ]
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


def _number(value: float, digits: int = 1) -> str:
    return f"{round(float(value), digits) + 0.0:g}"


def _outcome(run: Result) -> str:
    return f"{run.metrics['time_difference']:.2f} s apart"
