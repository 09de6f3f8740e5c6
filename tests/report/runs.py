"""Results made up for the pages: a grasp by formula, components in a ring, the timing of a run."""

from collections import Counter

import numpy as np
from grasp_cosim.realtime.timing import Histogram, Overrun, Spread, Timing
from grasp_cosim.recording.recorded_run import Rejection
from grasp_cosim.recording.result import Result
from grasp_cosim.system.times import NANOSECONDS

WIDTH, CENTRE = 0.07, 0.01
TOUCH = {1: 1.0, 2: 1.2}
"""s; a finger closes until then at an even speed, then stands still."""
START = {1: 0.11, 2: -0.11}
SIDE = {1: 1.0, 2: -1.0}

EXPERIMENT = {
    "system": "grasp.toml",
    "scheme": "sequential",
    "step": 1e-3,
    "stop": 2.0,
    "initialisation": {"loops": "iterate", "tolerance": 1e-10, "iterations": 50},
}

ORIGIN = {"date": "2026-01-02T03:04:05+00:00", "versions": {"grasp-cosim": "1.2.3"}}


def evenly(rows, span_ns):
    """Times in s as they are recorded, so that they are the same when read back."""
    return np.asarray(np.arange(rows) * (span_ns // max(rows - 1, 1)) / NANOSECONDS)


def component(fmu, **values):
    """The entry of a component in run.json."""
    return {"fmu": fmu, "values": values, "step": None, "isolation": "none", "rename": {}}


def connection(source, target, factor=None):
    """The entry of a connection in run.json."""
    return {"from": source, "to": target, "factor": factor, "offset": None}


def position(finger, t):
    """Where a finger of grasp_run() is at t, in m."""
    end = CENTRE + SIDE[finger] * WIDTH / 2
    return START[finger] + (end - START[finger]) * min(t / TOUCH[finger], 1.0)


def grasp_run(rows=2001):
    """Two fingers that close on an object, one 0.2 s after the other, 2 s long."""
    time = evenly(rows, 2 * NANOSECONDS)
    signals = {}
    for j in (1, 2):
        x = np.array([position(j, t) for t in time])
        touching = time >= TOUCH[j]
        signals |= {
            f"plant.position[{j}]": x,
            f"plant.velocity[{j}]": np.gradient(x, time),
            f"plant.gap[{j}]": SIDE[j] * (x - CENTRE) - WIDTH / 2,
            f"plant.contact_force[{j}]": np.where(touching, SIDE[j] * 3.4, 0.0),
            f"plant.contact[{j}]": touching,
            f"controller.force[{j}]": np.where(touching, -SIDE[j] * 3.4, -SIDE[j] * 0.1),
        }
    signals |= {
        "plant.object_position": np.full(rows, CENTRE),
        "controller.target_position": CENTRE * (1.0 - np.exp(-time)),
        "sensor_1.intensity": 0.01 / (signals["plant.gap[1]"] + 0.005),
        "sensor_2.intensity": 0.01 / (signals["plant.gap[2]"] + 0.005),
    }
    of = {"position": "m", "velocity": "m/s", "gap": "m", "contact_force": "N", "force": "N"}
    units = {name: of.get(name.partition(".")[2].partition("[")[0]) for name in signals}
    units |= {"plant.object_position": "m", "controller.target_position": "m"}
    settings = {
        **EXPERIMENT,
        "components": {
            "plant": component("GripperPlant.fmu", object_width=WIDTH),
            "sensor_1": component("ProximitySensor.fmu"),
            "sensor_2": component("ProximitySensor.fmu"),
            "controller": component("GraspController.fmu"),
        },
        "connections": [
            *(connection(f"plant.gap[{j}]", f"sensor_{j}.gap") for j in (1, 2)),
            *(connection(f"plant.position[{j}]", f"controller.position[{j}]") for j in (1, 2)),
            *(connection(f"plant.velocity[{j}]", f"controller.velocity[{j}]") for j in (1, 2)),
            *(connection(f"sensor_{j}.intensity", f"controller.intensity[{j}]") for j in (1, 2)),
            *(connection(f"controller.force[{j}]", f"plant.force[{j}]") for j in (1, 2)),
        ],
        "events": [{"at": 0.5, "set": {"sensor_1.reflectance": 0.6}}],
        "faults": [{"connection": "controller.intensity[1]", "kind": "bias", "value": 0.1}],
        "roles": {},
        "metrics": ["grasp"],
    }
    return Result(
        settings, time, signals, units, wall_time=1.5, complete=True,
        descriptions={"plant.gap[1]": "l_1, distance"},
        rejections={"sensor_2": Rejection(3, 0.25)},
        log=("t = 0.5 s: sensor_1.reflectance = 0.6",), origin=ORIGIN,
    )  # fmt: skip


def ring_run(names, rows=50):
    """Components connected in a ring, each with an output y."""
    time = evenly(rows, 98 * NANOSECONDS // 100)
    signals = {f"{name}.y": np.sin(time + k) for k, name in enumerate(names)}
    settings = {
        **EXPERIMENT,
        "components": {name: component(f"{name}.fmu") for name in names},
        "connections": [
            connection(f"{a}.y", f"{b}.u")
            for a, b in zip(names, [*names[1:], names[0]], strict=True)
        ],
        "events": [],
        "faults": [],
        "roles": {},
    }
    units = dict.fromkeys(signals)
    return Result(settings, time, signals, units, wall_time=1.5, complete=True, origin=ORIGIN)


def write_run(folder, result):
    """As `run --out` does."""
    folder.mkdir()
    result.to_csv(folder / "signals.csv")
    result.to_json(folder / "run.json")


def rounded(value):
    """JSON with its numbers to nine digits, which are those of any machine."""
    if isinstance(value, dict):
        return {key: rounded(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [rounded(entry) for entry in value]
    return float(f"{value:.9g}") if isinstance(value, float) else value


PERIOD = 1e-3
EDGES = np.geomspace(1e-8, 10.0, 181)
BULK = {"plant": 24e-6, "sensor_1": 6e-6, "sensor_2": 6e-6, "controller": 14e-6}
"""Medians in s of the components."""
AROUND = {"start": 3e-6, "recording": 8e-7, "between": 1e-6}


def paced(steps=60_000, hiccups=12, components=BULK, listed=1000):
    """The timing of steps of which so many were made late by one part each."""
    k, inside = np.arange(steps), {**components, "exchange": 2e-6}
    either = {
        name: median * np.exp(0.3 * np.sin((i + 1.3) * k))
        for i, (name, median) in enumerate({**inside, **AROUND}.items())
    }
    late = []
    for n in range(hiccups):
        step, culprit = n * (steps // hiccups) + 3, [*either][n % len(either)]
        either[culprit][step] += PERIOD * (1.0 + n % 5)
        took = float(either[culprit][step])
        late.append(Overrun(step, step * PERIOD, PERIOD * (n % 5 + 0.1), culprit, took))
    parts = {"step": np.sum([either[name] for name in inside], axis=0), **either}
    return Timing(
        1.0, PERIOD, "catch-up", ("SCHED_FIFO, priority 50",), ("memory not locked",), steps, 1.0,
        hiccups, tuple(late[:listed]), dict(Counter(o.culprit for o in late).most_common()),
        parts={name: _spread(times) for name, times in parts.items()},
        histograms={name: _histogram(times) for name, times in parts.items()},
    )  # fmt: skip


def _spread(times):
    """Each quantile is a time that occurred."""
    median, p99, p999 = np.quantile(times, (0.5, 0.99, 0.999), method="inverted_cdf").tolist()
    worst = int(times.argmax())
    return Spread(median, p99, p999, float(times[worst]), worst * PERIOD)


def _histogram(times):
    """No empty bins at the ends."""
    counts = np.histogram(times, EDGES)[0]
    first, *_, last = np.flatnonzero(counts).tolist()
    edges = EDGES[first : last + 2]
    return Histogram(tuple(edges.tolist()), tuple(counts[first : last + 1].tolist()))
