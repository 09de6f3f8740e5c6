"""A block in C gives the bits of the block in Python: parameters, inputs and steps by chance."""

import ctypes
import math
import struct
from pathlib import Path
from random import Random
from typing import Any

import pytest
from c_compilers import LIBM
from grasp_fmus.contract import build_params, declared, packer, unpacker, variables
from grasp_fmus.native import blocks as translation
from grasp_fmus.shipped import blocks
from grasp_fmus.slave import _scalars
from support.compiled import compile_c
from support.native_fmus import needs_gcc

pytestmark = needs_gcc

C = Path(translation.__file__).with_name("c")
DRIVER = Path(__file__).with_name("block_driver.c")
FLAGS = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]
FLAGS += ["-ffp-contract=off", *(f"-fno-builtin-{name}" for name in LIBM)]
NAMES = [name for name in blocks() if "MuJoCo" not in name]


def library(name: str, block: Any, folder: Path, cc: str = "gcc") -> ctypes.CDLL:
    """The block in C."""
    (folder / "block.h").write_text(translation.translated(name, block), "ascii")
    command = [cc, *FLAGS, "-shared", "-fPIC", f"-I{folder}", f"-I{C}", str(DRIVER), "-lm"]
    return ctypes.CDLL(str(compile_c(command, folder / f"{name}.so")))


def value(v: Any, random: Random) -> Any:
    """Of a variable: as declared, or by chance within its range."""
    start = float(v.start or 0.0)
    if random.random() < 0.4:
        return v.kind(start)
    low, high = v.limits or (-math.inf, math.inf)
    if v.kind is bool:
        return random.random() < 0.5
    if v.kind is int:
        return random.randint(int(low), int(high))
    size = (
        math.exp(random.uniform(-10.0, 4.0)) if random.random() < 0.3 else 0.3 * abs(start) + 0.01
    )
    return min(max(random.gauss(start, size), low), high)


def bits(numbers: Any) -> list[bytes]:
    """One NaN is as good as another."""
    return [struct.pack("<d", math.nan if x != x else x) for x in map(float, numbers)]


def run(found: ctypes.CDLL, block: Any, random: Random, steps: int) -> int:
    """One run in both, with a state saved and restored in each step; the number of values."""
    fields = declared(block)
    listed, pack, unpack = variables(fields), packer(block.Inputs, fields), unpacker(fields)
    values = [value(v, random) for v in listed]
    reason = ctypes.create_string_buffer(2000)
    sizes = (ctypes.c_int * 3)()
    found.sizes(sizes)
    state, seen = (ctypes.c_double * max(1, sizes[2]))(), (ctypes.c_double * sizes[1])()

    def in_c() -> Any:
        return (ctypes.c_double * len(values))(*map(float, values))

    try:
        p = build_params(block, fields, values)
    except ValueError:
        assert not found.check(in_c(), reason)
        assert reason.value
        return 0
    assert found.check(in_c(), reason)
    x, h, count = block.initial_state(p, pack(values)), random.choice([1e-4, 1e-3, 1e-2]), 0
    found.initial_state(in_c(), state)
    for _ in range(steps):
        for i, v in enumerate(listed):
            if v.causality == "input" and random.random() < 0.5:
                values[i] = value(v, random)
        u, given = pack(values), in_c()
        found.outputs(given, state, seen)
        assert bits(seen) == bits(unpack(block.outputs(p, x, u)))
        x = block.step(p, x, u, h)
        found.step(given, ctypes.c_double(h), state)
        assert bits(state) == bits(_scalars(x))
        count += len(seen) + len(state)
    return count


@pytest.mark.parametrize("name", NAMES)
def test_c_gives_the_bits_of_python(name: str, tmp_path: Path) -> None:
    block = blocks()[name]
    found = library(name, block, tmp_path)
    assert sum(run(found, block, Random(seed), 12) for seed in range(20)) > 1_000
