"""What the tests of instances share: an instance of a native FMU, driven as the loop does."""

from contextlib import contextmanager

import numpy as np
from grasp_cosim.fmi.instance import dtype
from grasp_cosim.fmi.make_instance import load
from grasp_cosim.system.parts import Component
from support.marks import slow
from support.native_fmus import TYPES, build

KINDS = [("2.0", "none"), slow("2.0", "process"), ("3.0", "none"), ("3.0", "process")]
"""Every version, in this process and in one of its own."""

SAMPLES = {
    "Real": -1.25e-300, "Integer": -(2**31), "Float64": -1.25e-300, "Float32": 0.15625,
    "Int8": -128, "UInt8": 255, "Int16": -(2**15), "UInt16": 2**16 - 1, "Int32": -(2**31),
    "UInt32": 2**32 - 1, "Int64": -(2**63), "UInt64": 2**64 - 1, "Boolean": True,
    "Enumeration": 2, "String": "Grüße \N{SNOWMAN}",
}  # fmt: skip
"""A value by type, at the edge of what it holds where that has one."""


@contextmanager
def running(folder, version, isolation="none", values=None, capabilities=None):
    """An initialised instance named 'part' of the native FMU."""
    fmu = build(folder, version=version, capabilities=capabilities)
    instance = load(Component("part", fmu, {}, isolation=isolation))
    try:
        instance.enter_initialization(values or {}, 10.0)
        instance.exit_initialization()
        yield instance
    finally:
        instance.close()


class Bound:
    """The calls of an instance as a plan binds them, on buffers of its own."""

    def __init__(self, instance, step):
        self.instance = instance
        self.clock = np.zeros(2)
        self.step = instance.stepper(self.clock, step).python

    def exchange(self, action, *names):
        """The call that sets or gets the variables, and the buffer."""
        variables = [self.instance.interface.by_name[name] for name in names]
        data = np.zeros(len(names), dtype(self.instance.interface.version, variables[0].type))
        return self.instance.transfer(action, variables, data).python, data


def variable(instance, name):
    """The declared variable of that name."""
    return instance.interface.by_name[name]


def real(version):
    """The double precision type of a version."""
    return next(iter(TYPES[version]))
