"""The blocks that come with the package, and that of the docs, give the same bits in C."""

import math
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any

import pytest
from fmus.native.c_block import CBlock, PythonBlock, compiler, library, same
from grasp_fmus.block_build import _parsed, _run
from grasp_fmus.contract import longest_step
from grasp_fmus.native.old.translation import translated
from grasp_fmus.shipped import SCRIPTS, slave_class
from support.campaign import seeds
from support.slow import platforms

SHIPPED = [script.stem for script in sorted(SCRIPTS.glob("*.py")) if "MuJoCo" not in script.stem]
NAMES = [*SHIPPED, "SpringPlant"]
SPRING_PLANT = Path(__file__).parents[3] / "docs" / "spring_plant.py"

ODD = [0.0, -0.0, 5e-324, 1e-300, -1e-300, 1e150, -1e300, 1e300, 1.0, -1.0]
NOT_FINITE = [math.inf, -math.inf]
STEPS = [1e-4, 1e-3, 1e-2, 0.1, 1e-9, 5e-324, 1e3, 1e300]

Built = tuple[PythonBlock, dict[str, str]]


@pytest.fixture(scope="module")
def built() -> Iterator[dict[str, Built]]:
    """Each block with its C."""
    found = {}
    for name in SHIPPED:
        block = slave_class(SCRIPTS / f"{name}.py").block
        found[name] = PythonBlock(block), translated(name, block)
    with _run(SPRING_PLANT, _parsed(SPRING_PLANT)[1]) as block:
        found["SpringPlant"] = PythonBlock(block), translated("SpringPlant", block, SPRING_PLANT)
        yield found


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("shipped")


def _value(v: Any, start: float, random: Random) -> float:
    """Of an input or a parameter: as declared, usual, or at the end of its range."""
    if v.causality == "output" or random.random() < 0.5:
        return start
    low, high = v.limits or (-math.inf, math.inf)
    if v.kind is bool:
        return float(random.random() < 0.5)
    if v.kind is int:
        return float(random.randint(int(low), int(high)))
    if random.random() < 0.3:
        return min(max(random.choice(ODD), low), high)
    size = math.exp(random.uniform(-10.0, 5.0)) if random.random() < 0.3 else abs(start) + 0.1
    return min(max(random.gauss(start, size), low), high)


def _agree(found: CBlock, python: PythonBlock, random: Random, steps: int, odd: bool) -> None:
    """One run with parameters, inputs, steps and sometimes a state by chance."""
    v = [_value(x, s, random) for x, s in zip(python.variables, python.starts, strict=True)]
    checked = python.check(v)
    assert same(found.check(v), checked)
    if isinstance(checked, tuple):
        v = list(python.starts)
    x = python.initial_state(v)
    assert same(found.initial_state(v), x)
    for _ in range(steps):
        if isinstance(x, tuple):
            return
        if odd:
            x = [random.choice(ODD + NOT_FINITE) if random.random() < 0.1 else y for y in x]
            x = python.shaped(x)
        for i, variable in enumerate(python.variables):
            if variable.causality == "input" and random.random() < 0.5:
                v[i] = _value(variable, python.starts[i], random)
        h = random.choice(STEPS)
        if longest_step(python.block) < math.inf:
            h = min(h, 1e-4)  # of what has many sub-steps in a long one
        seen = python.outputs(v, x)
        assert same(found.outputs(v, x), seen)
        after = python.step(v, x, h)
        assert same(found.step(v, x, h), after), (v, x, h)
        x = after


def _many(found: CBlock, python: PythonBlock, seeds: range) -> None:
    for seed in seeds:
        _agree(found, python, Random(seed), steps=6, odd=seed % 3 == 0)


@pytest.mark.parametrize("name", NAMES)
def test_a_shipped_block_is_in_the_subset(built: dict[str, Built], name: str) -> None:
    files = built[name][1]
    assert "block.h" in files
    assert all(text.isascii() for text in files.values())
    assert max(len(line) for text in files.values() for line in text.splitlines()) <= 110


@pytest.mark.parametrize("name", NAMES)
def test_c_gives_the_bits_and_the_faults_of_python(
    built: dict[str, Built], folder: Path, name: str
) -> None:
    python, files = built[name]
    _many(CBlock(library(files, folder / name)), python, range(30))


@pytest.mark.slow
@pytest.mark.campaign
@pytest.mark.parametrize(
    ("cc", "flag"),
    [
        *[("gcc", "-O3"), ("clang", "-O2")],
        *(platforms("gcc", flag) for flag in ("-O0", "-O2")),
        *(platforms("clang", flag) for flag in ("-O0", "-O3")),
    ],
)
@pytest.mark.parametrize("name", NAMES)
def test_any_compiler_gives_the_bits_of_python(
    built: dict[str, Built], folder: Path, name: str, cc: str, flag: str
) -> None:
    python, files = built[name]
    _many(CBlock(library(files, folder / name, cc, flag)), python, seeds(400))


@pytest.mark.slow
@pytest.mark.campaign
@pytest.mark.parametrize("name", NAMES)
def test_the_sanitizers_find_nothing(built: dict[str, Built], folder: Path, name: str) -> None:
    """With the library in a Python that has them preloaded."""
    checks = "-fsanitize=address,undefined"
    path = library(built[name][1], folder / name, "gcc", checks, "-fno-sanitize-recover=all", "-O1")
    asan = subprocess.run(
        [compiler(), "-print-file-name=libasan.so"], capture_output=True, text=True, check=True
    ).stdout.strip()
    code = (
        "import sys; from pathlib import Path\n"
        "from fmus.native import test_shipped_blocks as t\n"
        f"python = t.python_block({name!r})\n"
        f"t._many(t.CBlock(Path({str(path)!r})), python, {seeds(200)})\n"
    )
    environment = {
        **os.environ,
        "LD_PRELOAD": asan,
        "ASAN_OPTIONS": "detect_leaks=0",
        "PYTHONPATH": str(Path(__file__).parents[2]),
    }
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


def python_block(name: str) -> PythonBlock:
    """A block by its name, for another process."""
    if name in SHIPPED:
        return PythonBlock(slave_class(SCRIPTS / f"{name}.py").block)
    with _run(SPRING_PLANT, _parsed(SPRING_PLANT)[1]) as block:
        return PythonBlock(block)


@pytest.mark.slow
def test_the_same_sources_give_the_same_bytes() -> None:
    code = (
        "from grasp_fmus.native.old.translation import translated\n"
        "from grasp_fmus.shipped import blocks\n"
        "for name in ('GripperPlantMovable', 'ProximitySensor', 'GraspController'):\n"
        "    print(translated(name, blocks()[name]))\n"
    )
    texts = {
        subprocess.run(
            [sys.executable, "-c", code],
            env={**os.environ, "PYTHONHASHSEED": str(seed)},
            capture_output=True,
            check=True,
        ).stdout
        for seed in (1, 2)
    }
    assert len(texts) == 1
    assert os.sep + "work" not in texts.pop().decode()
