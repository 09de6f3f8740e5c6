"""Drives the host in C (fmus/native/hosts/host.c): scripts of commands, and the closed loop."""

import os
import struct
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import fmpy
import numpy as np

from .direct import COMPONENTS, CONNECTIONS
from .fmi2 import Fmu

SOURCE = Path(__file__).parents[1] / "fmus" / "native" / "hosts" / "host.c"
HEADERS = Path(fmpy.__file__).parent / "c-code"
MISSING = 99
"""The status of a command that the host could not even try."""


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
