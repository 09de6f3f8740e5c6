"""Drives the host in C (fmus/native/hosts/host.c): scripts of commands, and the closed loop."""

import os
import struct
import subprocess
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import fmpy
import numpy as np
import numpy.typing as npt
from grasp_cosim.grasp.presets import SYSTEM
from grasp_fmus.contract import build_params, declared, packer, unpacker, variables
from grasp_fmus.shipped import blocks

from .fmi2 import Fmu

SOURCE = Path(__file__).parents[1] / "fmus" / "native" / "hosts" / "host.c"
HEADERS = Path(fmpy.__file__).parent / "c-code"
MISSING = 99
"""The status of a command that the host could not even try."""

Rows = npt.NDArray[np.float64]

GRASP = tomllib.loads(SYSTEM.read_text("utf-8"))
COMPONENTS = {name: Path(c["fmu"]).stem for name, c in GRASP["components"].items()}
CONNECTIONS = [
    (*source.split(".", 1), *target.split(".", 1))
    for source, target in (text.split(" -> ") for text in GRASP["connections"])
]
"""Of the grasp: FMUs by component; source, output, target, input."""

BENCH = {
    **GRASP["presets"]["bench"],
    "sensor_1.pattern.enabled": True,
    "sensor_2.surface": 4,
    "plant.friction.coulomb[1]": 0.7,
    "plant.friction.viscous[2]": 3.0,
    "plant.initial_object_position": 0.02,
}
"""Values that have every function of a block run, and all of libm's that they call."""


# The host


def bits(value):
    """A number as the host reads it."""
    return struct.pack(">d", value).hex()


def number(word):
    """A number that the host wrote."""
    return float(struct.unpack(">d", bytes.fromhex(word))[0])


class Answer(NamedTuple):
    """What the host says of a command."""

    command: str
    status: int
    found: list[str]
    said: list[tuple[int, str, str, str]]
    """What the FMU logged: status, category, instance, text."""


@dataclass(frozen=True)
class Host:
    """The host, compiled for a platform; what runs it there."""

    program: Path
    wrapper: tuple[str, ...] = ()
    environment: Mapping[str, str] = field(default_factory=dict)

    def run(self, *scripts, folder, **environment):
        """Follow scripts in as many threads; the answers to each. The host must end well."""
        words = []
        for i, script in enumerate(scripts):
            path = folder / f"script_{i}"
            path.write_bytes("".join(f"{line}\n" for line in script.lines).encode(*RAW))
            words += [str(path), str(folder / f"answers_{i}")]
        done = subprocess.run(
            [*self.wrapper, str(self.program), *words],
            env={"PATH": os.environ["PATH"], "HOME": str(folder), **self.environment,
                 **environment},
            cwd=folder, capture_output=True, text=True, timeout=600,
        )  # fmt: skip
        assert done.returncode == 0, f"{done.returncode}: {done.stdout}{done.stderr}"
        return [
            list(_answers((folder / f"answers_{i}").read_bytes().decode(*RAW)))
            for i in range(len(scripts))
        ]


RAW = ("utf-8", "surrogateescape")
"""Names of instances need not be text."""


def _answers(text):
    said = []
    for line in text.splitlines():
        words = line.split("\t")
        if words[0] == "log":
            said.append((int(words[1]), words[2], words[3], words[4]))
        elif len(words) > 1:
            yield Answer(words[0], int(words[1]), words[2:], said)
            said = []
        else:
            yield Answer(line, MISSING, [], said)  # what the loader says


class Script:
    """Commands for the host, in their order."""

    def __init__(self):
        self.lines = []

    def add(self, *words):
        self.lines.append("\t".join("-" if word is None else str(word) for word in words))
        return self


@dataclass(frozen=True)
class Part:
    """A component of the grasp: its FMU, and the library to load."""

    fmu: Fmu
    library: Path


class Grasp:
    """Scripts of the closed loop, with parts by the names of their FMUs.

    `plant` and `controller` are the FMUs of these; values are by COMPONENT.VARIABLE.
    """

    def __init__(self, parts, values=None, plant="GripperPlant", controller="GraspController"):
        names = {**COMPONENTS, "plant": plant, "controller": controller}
        self.parts = {component: parts[name] for component, name in names.items()}
        self.values = values or {}
        self.index = {component: i for i, component in enumerate(self.parts)}

    def load(self, script):
        for component, part in self.parts.items():
            script.add("load", self.index[component], part.fmu.fmi, part.library)

    def unload(self, script):
        for i in self.index.values():
            script.add("unload", i)

    def make(self, script, callbacks="full", resources=None):
        """Make the instances, connect them, and say what is recorded."""
        for component, part in self.parts.items():
            i, fmu = self.index[component], part.fmu
            script.add("new", i, i, callbacks, component, fmu.guid, resources)
        for source, output, target, name in CONNECTIONS:
            from_, to = self.parts[source].fmu, self.parts[target].fmu
            script.add(
                "connect", self.index[target], to.references[name], self.index[source],
                from_.references[output],
            )  # fmt: skip

    def initialise(self, script):
        for name, value in self.values.items():
            component, _, variable = name.partition(".")
            fmu = self.parts[component].fmu
            place = (self.index[component], fmu.kinds[variable].lower(), fmu.references[variable])
            script.add("set", *place, bits(float(value)))
        for i in self.index.values():
            script.add("init", i, bits(0.0))
        for component, i in self.index.items():
            if component != "plant":  # which has its start values: the loop is closed by a step
                script.add("feed", i)
        for i in self.index.values():
            script.add("leave", i)

    def record(self, script, rows):
        """Record from now on; first of all the outputs of now."""
        for component, part in self.parts.items():
            for name in part.fmu.names("output"):
                script.add(
                    "record",
                    self.index[component],
                    part.fmu.kinds[name].lower(),
                    part.fmu.references[name],
                )
        script.add("rows", rows).add("row")

    def end(self, script):
        for i in self.index.values():
            script.add("terminate", i).add("free", i)

    def all_of(self, script, command, *words):
        """A command for each instance, whose number is its first word, and a state's the second."""
        for i in self.index.values():
            script.add(command, i, i, *words)

    def whole(self, rows, steps, h):
        """A whole run, from load to unload."""
        script = Script()
        self.load(script)
        self.make(script)
        self.initialise(script)
        self.record(script, rows)
        script.add("loop", 0, steps, bits(h))
        self.end(script)
        self.unload(script)
        return script

    def read(self, rows):
        """What was recorded, one row for each communication point."""
        return np.fromfile(rows).reshape(-1, len(self.columns()))

    def columns(self):
        """The outputs in a row, as COMPONENT.VARIABLE."""
        return [
            f"{c}.{name}" for c, part in self.parts.items() for name in part.fmu.names("output")
        ]


def good(answers):
    """Every command was answered with OK, and nothing was logged."""
    assert [answer for answer in answers if answer.status or answer.said] == []


# The same loop, of the blocks


class _Block:
    def __init__(self, name, values):
        self.block = blocks()[name]
        fields = declared(self.block)
        self.names = {v.name: i for i, v in enumerate(variables(fields))}
        self.values = [start for f in fields for start in f.starts]
        for variable, value in values.items():
            self.values[self.names[variable]] = value
        self.params = build_params(self.block, fields, self.values)
        self.pack, self.unpack = packer(self.block.Inputs, fields), unpacker(fields)
        self.first_output = sum(len(f.names) for f in fields if f.causality == "input")
        self.x = None

    def advance(self, h):
        """A step of h seconds; without one, the initial state."""
        u = self.pack(self.values)
        if h:
            self.x = self.block.step(self.params, self.x, u, h)
        else:
            self.x = self.block.initial_state(self.params, u)
        self.outputs = self.unpack(self.block.outputs(self.params, self.x, u))
        end = self.first_output + len(self.outputs)
        self.values[self.first_output : end] = self.outputs


def rows_in_python(values, steps, h, plant="GripperPlant", controller="GraspController"):
    """The outputs that the blocks have at each communication point, in a plain loop in Python."""
    own = {component: {} for component in COMPONENTS}
    for name, value in values.items():
        component, _, variable = name.partition(".")
        own[component][variable] = value
    parts = {
        component: _Block(name, own[component])
        for component, name in {**COMPONENTS, "plant": plant, "controller": controller}.items()
    }
    feeds = {
        component: [
            (parts[source], parts[source].names[output], parts[component].names[name])
            for source, output, target, name in CONNECTIONS
            if target == component
        ]
        for component in parts
    }
    rows = []
    for k in range(steps + 1):
        for component, part in parts.items():
            for source, from_, to in feeds[component] if k or component != "plant" else ():
                part.values[to] = source.values[from_]
            part.advance(h if k else 0.0)
        rows.append([value for part in parts.values() for value in part.outputs])
    return np.array(rows, dtype=np.float64)
