"""The closed loop by plain calls of the blocks: what the co-simulated FMUs must reproduce.

The order is that of the master's sequential scheme: plant, sensors, controller; each one steps
with what those before it have just put out, and the plant with the force it was last given.
"""

from typing import Any

import numpy as np
import numpy.typing as npt
from grasp_controller import series
from gripper_plant import rigid
from proximity_sensor import optics

Signals = dict[str, npt.NDArray[Any]]
"""By the names of the FMUs' outputs, and "time"."""

Sensors = tuple[optics.Params, optics.Params]
Row = tuple[rigid.Outputs, tuple[optics.Outputs, optics.Outputs], series.Outputs]
"""All outputs of one communication point."""


def closed_loop(plant, sensors, controller, step, steps, *, until_contact=False):
    """Every output at every communication point, steps of step s; until_contact stops as soon as
    both fingers have touched. step must be a whole number of nanoseconds.
    """
    x_p = rigid.initial_state(plant, rigid.Inputs())
    y_p = rigid.outputs(plant, x_p, rigid.Inputs())
    y_s = _sense(sensors, y_p)
    u_c = _samples(y_p, y_s)
    x_c = series.initial_state(controller, u_c)
    y_c = series.outputs(controller, x_c, u_c)
    rows = [(y_p, y_s, y_c)]
    touched_1, touched_2 = y_p.contact
    for _ in range(steps):
        if until_contact and touched_1 and touched_2:
            break
        u_p = rigid.Inputs(y_c.force)
        x_p = rigid.step(plant, x_p, u_p, step)
        y_p = rigid.outputs(plant, x_p, u_p)
        y_s = _sense(sensors, y_p)
        u_c = _samples(y_p, y_s)
        x_c = series.step(controller, x_c, u_c, step)
        y_c = series.outputs(controller, x_c, u_c)
        rows.append((y_p, y_s, y_c))
        touching_1, touching_2 = y_p.contact
        touched_1, touched_2 = touched_1 or touching_1, touched_2 or touching_2
    return {"time": np.arange(len(rows)) * round(step * 1e9) / 1e9, **_signals(rows)}


def _sense(sensors, y):
    """The optics have no memory, so their outputs are all there is to them."""
    p_1, p_2 = sensors
    gap_1, gap_2 = y.gap
    return (
        optics.outputs(p_1, optics.Inputs(gap_1)),
        optics.outputs(p_2, optics.Inputs(gap_2)),
    )


def _samples(y_p, y_s):
    y_1, y_2 = y_s
    return series.Inputs(y_p.position, y_p.velocity, (y_1.intensity, y_2.intensity))


def _signals(rows):
    """The rows as columns under the names of the FMUs' outputs."""
    plants, sensed, controllers = zip(*rows, strict=True)
    first, second = zip(*sensed, strict=True)
    return {
        **_columns("plant", plants),
        **_columns("sensor_1", first),
        **_columns("sensor_2", second),
        **_columns("controller", controllers),
    }


def _columns(component, outputs):
    columns = {}
    for name in outputs[0]._fields:
        values = np.array([getattr(y, name) for y in outputs])
        if values.ndim == 1:
            columns[f"{component}.{name}"] = values
        else:
            for j, column in enumerate(values.T, start=1):
                columns[f"{component}.{name}[{j}]"] = column.copy()
    return columns
