"""A block, a mass that is pushed with a fault on demand, and native FMUs of it."""

import platform
import sys
import zipfile
from dataclasses import dataclass
from math import inf, nan
from pathlib import Path
from typing import Annotated, NamedTuple

from block_variables import Input, Output, Parameter, check
from grasp_cosim.fmu_export.contract import declared, variables
from grasp_cosim.fmu_export.description import Description, model_description
from grasp_cosim.fmu_export.native.blocks import translated
from grasp_cosim.fmu_export.native.sources import native_sources
from support.compiled import compile_c

LONGEST_STEP = 1.0


@dataclass(frozen=True)
class Params:
    """Of the mass."""

    mass: Annotated[float, Parameter("m", unit="kg", low=1e-3, high=1e3)] = 0.5
    gain: Annotated[float, Parameter("K", unit="1", low=0.0, high=10.0, tunable=True)] = 1.0
    start: Annotated[float, Parameter("x_0", unit="m")] = 0.0
    seed: Annotated[int, Parameter("seed", low=0, high=2147483647)] = 1
    fault: Annotated[int, Parameter("what goes wrong", low=0, high=3, tunable=True)] = 0
    noisy: Annotated[bool, Parameter("has noise")] = False

    def __post_init__(self):
        check(self)
        if self.noisy and self.seed == 0:
            raise ValueError("seed = 0: must be above 0 with noise, 100 %")


class Inputs(NamedTuple):
    """Of the mass."""

    force: Annotated[float, Input("F", unit="N", nominal=1.0)] = 0.0
    held: Annotated[bool, Input("does not move")] = False


class State(NamedTuple):
    """Of the mass."""

    position: float
    velocity: float
    steps: float
    moves: bool


class Outputs(NamedTuple):
    """Of the mass."""

    position: Annotated[float, Output("x", unit="m", nominal=1.0, depends_on=set())]
    velocity: Annotated[float, Output("v", unit="m/s", nominal=1.0, depends_on=set())]
    moves: Annotated[bool, Output("moves", depends_on=set(), depends_initially_on={"held"})]


def initial_state(p, u):
    return State(nan if p.fault == 2 else p.start, 0.0, 0.0, not u.held)


def step(p, x, u, h):
    acceleration = 0.0 if u.held else p.gain * u.force / p.mass
    velocity = inf if p.fault == 1 else x.velocity + h * acceleration
    return State(x.position + h * velocity, velocity, x.steps + 1.0, velocity != 0.0)


def outputs(p, x, u):
    return Outputs(x.position, nan if p.fault == 3 else x.velocity, x.moves)


NAME = "Mass"
GUID = "{0f1e2d3c}"
CONTENT = "0123456789abcdef"
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fvisibility=hidden", "-fPIC", "-shared")
STRICT = ("-Wall", "-Wextra", "-Wpedantic", "-Werror")
CHECKED = "-DTEXT_LIKE_PRINTF=__attribute__((format(printf, 2, 3)))"
"""Has the formats of messages checked."""

BLOCK = sys.modules[__name__]


def write_sources(folder, fmi=2):
    """The C sources, in a folder that is made."""
    folder.mkdir(parents=True)
    text = translated(NAME, BLOCK, Path(__file__))
    for file, data in native_sources(NAME, text, CONTENT, GUID, fmi).items():
        (folder / file).write_bytes(data)


def compile_in(folder, fmi=2, options=()):
    """The shared library of sources in a folder; without warnings."""
    plain = (f"-DFMI{fmi}_OVERRIDE_FUNCTION_PREFIX", *options, str(folder / f"{NAME}.c"), "-lm")
    return compile_c(["gcc", *FLAGS, *STRICT, CHECKED, *plain], folder / f"{NAME}.so")


def native_fmu(folder, fmi=2, options=()):
    """A native FMU for this machine, without what only a reader needs."""
    write_sources(folder / "sources", fmi)
    library = compile_in(folder / "sources", fmi, options)
    description = Description(NAME, "Mass", variables(declared(BLOCK)))
    place = "linux64" if fmi == 2 else f"{platform.machine()}-linux"
    fmu = folder / f"{NAME}.fmu"
    with zipfile.ZipFile(fmu, "w") as archive:
        xml = model_description(description, GUID, fmi, native=True)
        archive.writestr("modelDescription.xml", xml)
        archive.write(library, f"binaries/{place}/{NAME}.so")
    return fmu
