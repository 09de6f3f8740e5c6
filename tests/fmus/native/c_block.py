"""A block in C behind the functions of shim.c, beside the same block in Python."""

import ctypes
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from dis import opname
from pathlib import Path
from typing import Any

import pytest
from c_compilers import LIBM
from grasp_fmus.contract import build_params, declared, packer, unpacker
from grasp_fmus.contract import variables as scalar_variables
from grasp_fmus.native.old import translation
from grasp_fmus.snapshot import _scalars, _shaped
from support.compiled import compile_c

HERE = Path(__file__).parent
HEADERS = Path(translation.__file__).parents[1] / "c"
FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-ffp-contract=off"]
FLAGS += [f"-fno-builtin-{name}" for name in LIBM]

KINDS = {1: ArithmeticError, 2: ArithmeticError, 3: ValueError, 4: Exception}

PYTHONS_OWN = "the text of an operation of Python's, another in each version"

Outcome = tuple[str, ...] | list[float]
"""Numbers, or the kind, type and text of a fault."""


def compiler(name: str = "gcc") -> str:
    found = shutil.which(name)
    if found is None:
        pytest.skip(f"there is no {name}")
    return found


def library(files: Mapping[str, str], folder: Path, cc: str = "gcc", *flags: str) -> Path:
    """The shared library of a translated block."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        (folder / name).write_text(text, "ascii")
    out = folder / f"block{'_'.join(flags)}_{cc}.so"
    command = [
        compiler(cc),
        *FLAGS,
        *(flags or ["-O1"]),
        "-fPIC",
        "-shared",
        f"-I{folder}",
        f"-I{HEADERS}",
    ]
    return compile_c([*command, str(HERE / "shim.c"), "-lm"], out)


class CBlock:
    """The functions of a block in C."""

    def __init__(self, path: Path) -> None:
        self._lib = ctypes.CDLL(str(path))
        sizes = (ctypes.c_int * 3)()
        self._lib.shim_sizes(sizes)
        self.n_variables, self.n_outputs, self.n_state = list(sizes)

    def _run(self, name: str, v: list[float], *rest: Any, size: int) -> Outcome:
        out = (ctypes.c_double * max(size, 1))()
        kind, text = ctypes.create_string_buffer(64), ctypes.create_string_buffer(1024)
        given = [
            (ctypes.c_double * max(len(r), 1))(*r) if isinstance(r, list) else ctypes.c_double(r)
            for r in (v, *rest)
        ]
        outs = [out] if size else []
        fault = getattr(self._lib, f"shim_{name}")(*given, *outs, kind, text)
        if fault:
            return str(fault), kind.value.decode(), text.value.decode()
        return list(out)[:size]

    def check(self, v: list[float]) -> Outcome:
        return self._run("check", v, size=0)

    def initial_state(self, v: list[float]) -> Outcome:
        return self._run("initial_state", v, size=self.n_state)

    def step(self, v: list[float], state: list[float], h: float) -> Outcome:
        return self._run("step", v, state, h, size=self.n_state)

    def outputs(self, v: list[float], state: list[float]) -> Outcome:
        return self._run("outputs", v, state, size=self.n_outputs)


@dataclass
class PythonBlock:
    """The same functions of a block in Python."""

    block: Any

    def __post_init__(self) -> None:
        self.fields = declared(self.block)
        self.variables = scalar_variables(self.fields)
        self.starts = [0.0 if v.start is None else float(v.start) for v in self.variables]
        self._pack = packer(self.block.Inputs, self.fields)
        self._unpack = unpacker(self.fields)
        self._like = self.block.initial_state(self.block.Params(), self.block.Inputs())

    def shaped(self, numbers: list[float]) -> list[float]:
        """The numbers of a state as it holds them: whole ones where it has integers."""
        try:
            return [float(x) for x in _scalars(_shaped(self._like, iter(numbers)))]
        except (OverflowError, ValueError):
            return numbers

    def values(self, v: list[float]) -> list[Any]:
        kinds = [variable.kind for variable in self.variables]
        return [kind(x) for kind, x in zip(kinds, v, strict=True)]

    def _given(self, v: list[float]) -> tuple[Any, Any]:
        values = self.values(v)
        return build_params(self.block, self.fields, values), self._pack(values)

    def check(self, v: list[float]) -> Outcome:
        def build() -> list[float]:
            self._given(v)
            return []

        return outcome(build)

    def initial_state(self, v: list[float]) -> Outcome:
        p, u = self._given(v)
        return outcome(lambda: _scalars(self.block.initial_state(p, u)))

    def step(self, v: list[float], state: list[float], h: float) -> Outcome:
        p, u = self._given(v)
        return outcome(lambda: _scalars(self.block.step(p, _shaped(self._like, iter(state)), u, h)))

    def outputs(self, v: list[float], state: list[float]) -> Outcome:
        p, u = self._given(v)
        return outcome(
            lambda: self._unpack(self.block.outputs(p, _shaped(self._like, iter(state)), u))
        )


def outcome(run: Any) -> Outcome:
    """What Python gives, in the words of C."""
    try:
        return [float(x) for x in run()]
    except Exception as error:
        name, text = type(error).__name__, str(error) if was_raised(error) else PYTHONS_OWN
        if (
            "complex" in str(error) and str(error) != "complex exponentiation"
        ):  # where Python goes on with a complex number, C stops
            return "4", "TypeError", "a negative number to a fractional power is complex"
        if type(error) is ArithmeticError:
            return "1", name, text
        if isinstance(error, ArithmeticError):
            return "2", name, text
        return ("3" if isinstance(error, ValueError) else "4"), name, text


def was_raised(error: Exception) -> bool:
    """True if a statement `raise` made it, and False for an operator or a function in C."""
    at = error.__traceback__
    while at and at.tb_next:
        at = at.tb_next
    return at is not None and opname[at.tb_frame.f_code.co_code[at.tb_lasti]] == "RAISE_VARARGS"


def same(found: Outcome, expected: Outcome) -> bool:
    """True for the same bits, or the same fault as in Python; one NaN is as good as another."""
    if isinstance(found, tuple) and isinstance(expected, tuple):
        return found[:2] == expected[:2] and expected[2] in (found[2], PYTHONS_OWN)
    return [repr(x) for x in found] == [repr(x) for x in expected]
