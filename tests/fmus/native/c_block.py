"""A block in C behind the functions of block_driver.c, beside the same block in Python."""

import ctypes
import importlib.util
import math
import struct
import sys
from contextlib import contextmanager
from pathlib import Path

from grasp_cosim.base.c_compilers import BITS as DECIDING
from grasp_cosim.base.c_compilers import LIBM
from grasp_cosim.fmu_export.contract import build_params, declared, packer, unpacker, variables
from grasp_cosim.fmu_export.native import blocks as translation
from support.compiled import compile_c

C = Path(translation.__file__).with_name("c")
DRIVER = Path(__file__).with_name("block_driver.c")
STRICT = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]
BITS = [*DECIDING, *(f"-fno-builtin-{name}" for name in LIBM)]
RAISED = (ArithmeticError, ValueError, TypeError)
"""What Python raises where C has a value: TypeError of a complex number that is compared."""


@contextmanager
def loaded(file, source):
    """A block from its source, among the imported modules meanwhile."""
    file.write_text(source, "utf-8")
    spec = importlib.util.spec_from_file_location(file.stem, file)
    assert spec
    assert spec.loader
    module = sys.modules[file.stem] = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
        yield module
    finally:
        del sys.modules[file.stem]


def bits(numbers):
    """One NaN is as good as another."""
    return [struct.pack("<d", math.nan if x != x else x) for x in map(float, numbers)]


def flat(state):
    """All numbers of a state."""
    if not isinstance(state, tuple):
        return [float(state)]
    return [number for item in state for number in flat(item)]


class Both:
    """A block in C and in Python."""

    def __init__(self, name, block, folder, cc="gcc", options=("-O2",)):
        folder.mkdir(exist_ok=True)
        file = Path(block.__file__)
        (folder / "block.h").write_text(translation.translated(name, block, file), "ascii")
        flags = [*STRICT, *BITS, *options, "-shared", "-fPIC", f"-I{folder}", f"-I{C}"]
        out = compile_c([cc, *flags, str(DRIVER), "-lm"], folder / f"{name}.so")
        self.block, self.in_c, self.fields = block, ctypes.CDLL(str(out)), declared(block)
        self.variables = variables(self.fields)
        self.pack, self.unpack = packer(block.Inputs, self.fields), unpacker(self.fields)
        sizes = (ctypes.c_int * 3)()
        self.in_c.sizes(sizes)
        assert sizes[0] == len(self.variables)
        self.state = (ctypes.c_double * max(1, sizes[2]))()
        self.seen = (ctypes.c_double * sizes[1])()
        self.n_state = sizes[2]
        self.reason = ctypes.create_string_buffer(4096)

    def starts(self):
        """The start values of all variables."""
        return [v.kind(v.start or 0) for v in self.variables]

    def given(self, values):
        """Values for C."""
        return (ctypes.c_double * len(values))(*map(float, values))

    def check(self, values):
        """What C says of parameters; empty where it takes them."""
        good = self.in_c.check(self.given(values), self.reason)
        return "" if good else self.reason.value.decode()

    def run(self, values, inputs):
        """A run in both, whose state goes through numbers in each step; how many values agreed.

        `inputs` are, for each step, the values that change and how long it is. It ends where Python
        raises, and where parameters do not go together, which C must say.
        """
        try:
            p = build_params(self.block, self.fields, values)
        except ValueError:
            assert self.check(values)
            return 0
        assert self.check(values) == ""
        count = 0
        try:
            x = self.block.initial_state(p, self.pack(values))
            self.in_c.initial_state(self.given(values), self.state)
            count += self._same(self.state, flat(x)[: self.n_state], "initial_state", values)
            for changes, h in inputs:
                for i, value in changes.items():
                    values[i] = value
                u, given = self.pack(values), self.given(values)
                y = self.unpack(self.block.outputs(p, x, u))
                self.in_c.outputs(given, self.state, self.seen)
                count += self._same(self.seen, y, "outputs", values)
                x = self.block.step(p, x, u, h)
                self.in_c.step(given, ctypes.c_double(h), self.state)
                count += self._same(self.state, flat(x), "step", values)
        except RAISED:
            pass
        return count

    def _same(self, found, expected, what, values):
        assert bits([*found][: len(expected)]) == bits(expected), (what, values)
        return len(expected)

    def random_run(self, random, steps):
        """A run with parameters, inputs and a step by chance."""
        h = random.choice([1e-4, 1e-3, 1e-3, 3e-3])
        inputs = [i for i, v in enumerate(self.variables) if v.causality == "input"]

        def changes():
            return {i: drawn(self.variables[i], random) for i in inputs if random.random() < 0.5}

        values = [drawn(v, random) for v in self.variables]
        return self.run(values, ((changes(), h) for _ in range(steps)))


def drawn(v, random):
    """A value of a variable: as declared, or by chance within its range."""
    start = float(v.start or 0.0)
    if random.random() < 0.4 or v.causality == "output":
        return v.kind(start)
    low, high = v.limits or (-math.inf, math.inf)
    if v.kind is bool:
        return random.random() < 0.5
    if v.kind is int:
        return random.randint(int(low), int(high))
    if random.random() < 0.05:
        return min(max(random.choice([0.0, -0.0, 5e-324, 1e-300, 1e9]), low), high)
    size = math.exp(random.uniform(-10.0, 4.0)) if random.random() < 0.3 else abs(start) / 3 + 0.01
    return min(max(random.gauss(start, size), low), high)
