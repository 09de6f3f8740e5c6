"""The kinds of FMUs that a block becomes: run by Python, or native, for either version of FMI.

A test that loads FMUs runs on each kind that it, or its module, is marked with.
"""

from typing import Literal

import pytest
from grasp_cosim.fmu_export.build import build_block, build_model, planned
from grasp_cosim.fmu_export.package import shipped_model
from grasp_cosim.fmu_export.shipped import SHIPPED
from grasp_cosim.inspection.block_templates import TEMPLATE_FOLDER

from .marks import platforms, slow

Kind = Literal["python", "native", "native FMI 3"]

NATIVE = {"native": 2, "native FMI 3": 3}

all_kinds = pytest.mark.kinds("python", "native", "native FMI 3")
native_slowly = pytest.mark.parametrize(
    "kind", ["python", slow("native"), platforms("native FMI 3")], indirect=True
)
"""All kinds, of which `make test-slow` takes one that is native and `make platforms` the other."""
both_of_fmi_2 = pytest.mark.kinds("python", "native")
python_only = pytest.mark.kinds("python")

OWN = {"SpringPlant": TEMPLATE_FOLDER / "spring_plant.py"}
"""Blocks that are a file of one's own, by the names of their FMUs."""


NAMES = (*SHIPPED, *OWN)

TRANSLATED = [*SHIPPED]
"""The blocks that come with the package, of which there are native FMUs."""

QUICK = "ProximitySensor"
"""It has variables of every type, and sub-steps."""


def tier(name, kind, compiles):
    """Where it is tested: of FMI 2.0 one in the quick tests, unless it is altered, and all in the
    slow ones; of FMI 3.0 one in the slow ones, and all before a release.
    """
    if kind == "native FMI 3":
        return "slow" if name == QUICK and not compiles else "platforms"
    others = compiles or (name != QUICK and name in NAMES)
    return "slow" if kind == "native" and others else "quick"


def plan(kind):
    """How it is compiled; the test is skipped where there is no compiler."""
    try:
        return planned(fmi=NATIVE[kind])
    except ValueError as error:
        pytest.skip(f"NO compiler: {error}")


def build_shipped(name, kind, out):
    """Build one of those that come with the package."""
    return build_model(shipped_model(name), out, None if kind == "python" else plan(kind)).path


def build_own(name, kind, out):
    """Build the FMU of one of OWN."""
    return build_block(OWN[name], out, None if kind == "python" else plan(kind)).path
