"""The closed loop by plain calls of the blocks: what the co-simulated FMUs must reproduce.

The order is that of the master's sequential scheme: plant, sensors, controller; each one steps
with what those before it have just put out, and the plant with the force it was last given.
"""

import tomllib
from pathlib import Path

import numpy as np
from grasp_cosim.fmu_export.contract import build_params, declared, packer, unpacker, variables
from grasp_cosim.fmu_export.shipped import block_of
from grasp_cosim.grasp.presets import SYSTEM

GRASP = tomllib.loads(SYSTEM.read_text("utf-8"))
COMPONENTS = {name: Path(c["fmu"]).stem for name, c in GRASP["components"].items()}
CONNECTIONS = [
    (*source.split(".", 1), *target.split(".", 1))
    for source, target in (text.split(" -> ") for text in GRASP["connections"])
]
"""Of the grasp: FMUs by component; source, output, target, input."""

BENCH = {
    **GRASP["presets"]["bench"],
    "sensor_1.spot.enabled": True,
    "sensor_1.face.curvature": 10.0,
    "sensor_1.face.tilt": 0.1,
    "sensor_1.pattern.ratio": 0.57,
    "sensor_2.surface": 4,
    "plant.friction.coulomb[1]": 0.7,
    "plant.friction.viscous[2]": 3.0,
    "plant.initial_object_position": 0.02,
}
"""Values that have every function of a block run, and all of libm's that they call."""


class Part:
    """A block in the loop; without parameters it has those that its values say."""

    def __init__(self, name, values, params=None):
        self.block = block_of(name)
        fields = declared(self.block)
        self.names = {v.name: i for i, v in enumerate(variables(fields))}
        self.values = [start for f in fields for start in f.starts]
        for variable, value in values.items():
            self.values[self.names[variable]] = value
        self.params = params or build_params(self.block, fields, self.values)
        self.pack, self.unpack = packer(self.block.Inputs, fields), unpacker(fields)
        self.outputs = [v.name for v in variables(fields) if v.causality == "output"]

    def advance(self, h):
        """A step of h seconds; without one, the initial state."""
        u = self.pack(self.values)
        if h:
            self.x = self.block.step(self.params, self.x, u, h)
        else:
            self.x = self.block.initial_state(self.params, u)
        found = self.unpack(self.block.outputs(self.params, self.x, u))
        for name, value in zip(self.outputs, found, strict=True):
            self.values[self.names[name]] = value
        return found


def closed_loop(params, step, steps, *, values=None, until_contact=False, **fmus):
    """Every output at every communication point, steps of step s; until_contact stops as soon as
    both fingers have touched. step must be a whole number of nanoseconds.

    params are those of components, the others have values by COMPONENT.VARIABLE; fmus take the
    place of those of the grasp.
    """
    own = {component: {} for component in COMPONENTS}
    for name, value in (values or {}).items():
        component, _, variable = name.partition(".")
        own[component][variable] = value
    parts = {c: Part(fmus.get(c, n), own[c], params.get(c)) for c, n in COMPONENTS.items()}
    feeds = {component: [] for component in parts}
    for source, output, target, name in CONNECTIONS:
        from_, to = parts[source], parts[target]
        feeds[target].append((from_, from_.names[output], to.names[name]))
    rows, touched = [], set()
    for k in range(steps + 1):
        row = []
        for component, part in parts.items():
            for source, from_, to in feeds[component] if k or component != "plant" else ():
                part.values[to] = source.values[from_]
            row += part.advance(step if k else 0.0)
        rows.append(row)
        plant = parts["plant"]
        touched |= {j for j in (1, 2) if plant.values[plant.names[f"contact[{j}]"]]}
        if until_contact and len(touched) == 2:
            break
    names = [f"{component}.{name}" for component, part in parts.items() for name in part.outputs]
    columns = dict(zip(names, map(np.array, zip(*rows, strict=True)), strict=True))
    return {"time": np.arange(len(rows)) * round(step * 1e9) / 1e9, **columns}


def rows_in_python(values, steps, h, **fmus):
    """The same as an array with a row for each communication point, without the time."""
    _, *columns = closed_loop({}, h, steps, values=values, **fmus).values()
    return np.array(columns, dtype=np.float64).T.copy()
