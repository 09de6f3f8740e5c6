"""Writes the C of a block alone, for real-time targets: no FMI, no allocation, no stdio.

c_only*.in are its header and its code, for a block called Model; here they get the name and the
variables. Members are called as in the C header of a proxy (bench_header.py), so that
the structs of both are the same.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from string import Template

from ...base.c_compilers import BITS, LIBM
from ..contract import Scalar
from ..link import ORDER, Causality, Kind, LinkVariable, Signature, Value
from ..package import Model, write_file
from .bench_header import Group, lines_of, members, structs
from .blocks import translated
from .text import comment_text

FOLDER = Path(__file__).parent
HELPERS = ("arithmetic.h", "variable.h")
"""What the C of a block includes, from the folder c."""

EXACT = {"ceil": "ceiled", "copysign": "copysign", "fabs": "fabs", "floor": "floored"}
EXACT |= {"sqrt": "sqrt", "trunc": "truncated", "ldexp": "scaled"}
"""Functions that IEEE 754 fixes, so every compiler may work them out: as the block calls them."""

_MEANINGS: dict[Causality, str] = {
    "input": "What the block gets with every step; held meanwhile",
    "parameter": "What it is set up with",
    "output": "What it gives",
}
_KINDS: dict[type[Scalar], Kind] = {float: "Real", int: "Integer", bool: "Boolean"}


def c_only(model: Model) -> dict[str, bytes]:
    """Return the files of a block alone in C, by name.

    NAME.h and NAME.c; NAME_text.c, which tells in words why something is refused; main.c, an
    example; and what they include.

    UntranslatableError, one line, where the block holds what cannot be translated.
    """
    name, variables = model.description.name, model.description.variables
    block = translated(name, model.block, model.file)
    helpers = {file: (FOLDER / "c" / file).read_text("utf-8") for file in HELPERS}
    links = (LinkVariable(v.name, _KINDS[v.kind], v.causality, v.unit or None) for v in variables)
    signature = Signature(tuple(links))
    groups = [Group(name, c, f"{name}_{c.title()}s", members(signature, c)) for c in ORDER]
    inputs, parameters, outputs = groups
    first = len(variables) - len(parameters.members)
    lines = {
        "get_inputs": lines_of(inputs, "    v[{i}] = u->{name}{number};", "(void)u, (void)v;"),
        "get_parameters": lines_of(
            parameters, "    v[{i}] = p->{name}{number};", "(void)p, (void)v;", first
        ),
        "put_outputs": lines_of(outputs, "    y->{name} = v[{i}]{truth};", "(void)v, (void)y;"),
    }
    libm = called_of_libm(block)
    flags = (*BITS, *(f"-fno-builtin-{f}" for f in libm if f in LIBM))
    starts: dict[str, Value] = {v.name: v.start for v in variables if v.start is not None}
    texts = {
        "name": name,
        "summary": comment_text(model.description.summary),
        "libm": ", ".join(libm) or "nothing",
        "structs": structs(groups, _MEANINGS, starts, {v.name: v.description for v in variables}),
        "state_size": str(max(1, int(re.findall(r"N_STATE = (\d+)", block)[0]))),
        **{function: "\n".join(body) for function, body in lines.items()},
        "command": f"cc {' '.join(flags)} -o {name} main.c {name}.c {name}_text.c -lm",
        "format": " %.17g" * len(outputs.members),
        "arguments": "".join(f", (double)y->{member}" for _, member in outputs.members),
    }
    files = {
        f"{name}.h": "c_only.h.in",
        f"{name}.c": "c_only.c.in",
        f"{name}_text.c": "c_only_text.c.in",
        "given.h": "c_only_given.h.in",
        "main.c": "c_only_main.c.in",
    }
    written = {file: _filled(FOLDER / template, texts) for file, template in files.items()}
    return {file: text.encode() for file, text in {"block.h": block, **helpers, **written}.items()}


def write_c(folder: Path, model: Model) -> list[Path]:
    """Write the files of c_only() into a folder; return them."""
    files = {folder / name: data for name, data in sorted(c_only(model).items())}
    for path, data in files.items():
        write_file(path, data)
    return [*files]


def called_of_libm(block: str) -> list[str]:
    """Return the functions of libm that a block calls, sorted."""
    called = {*re.findall(r"\w+(?=\()", re.sub(r"/\*.*?\*/", "", block, flags=re.DOTALL))}
    exact = {name for name, as_called in EXACT.items() if as_called in called}
    return sorted(exact | (called & {*LIBM}))


def _filled(template: Path, texts: Mapping[str, str]) -> str:
    name = texts["name"]
    text = re.sub(r"\bModel_", f"{name}_", template.read_text("utf-8"))
    return Template(re.sub(r"\bMODEL_", f"{name.upper()}_", text)).substitute(texts)
