"""Writes the C of a single block, for real-time targets: no FMI, no allocation, no stdio.

c_only*.in are its header and its code, for a block called Model; here they get the name and the
variables. Members are called as in the C header of a proxy (bench_header.py), so that
the structs of both are the same.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from string import Template

from ...base.c_compilers import BITS, LIBM
from ..contract import Scalar, Variable
from ..link import ORDER, Causality, Kind, LinkVariable, Signature, Value
from ..package import Model, write_file
from .a2l import a2l_texts, layout, xcp_texts
from .bench_header import Group, lines_of, members, structs
from .blocks import translated
from .text import comment_text

FOLDER = Path(__file__).parent
HELPERS = ("arithmetic.h", "variable.h")
"""What the C of a block includes, from the folder c."""
XCP_HELPERS = ("xcp.h", "xcp_udp.h")
"""What its side of XCP includes, and the example for that."""

EXACT = {"ceil": "ceiled", "copysign": "copysign", "fabs": "fabs", "floor": "floored"}
EXACT |= {"sqrt": "sqrt", "trunc": "truncated", "ldexp": "scaled"}
"""Functions that IEEE 754 fixes, so every compiler may work them out: as the block calls them."""

_MEANINGS: dict[Causality, str] = {
    "input": "What the block gets with every step; held meanwhile",
    "parameter": "What it is set up with",
    "output": "What it gives",
}
_TEMPLATES = {
    "NAME.h": "c_only.h.in",
    "NAME.c": "c_only.c.in",
    "NAME_text.c": "c_only_text.c.in",
    "given.h": "c_only_given.h.in",
    "main.c": "c_only_main.c.in",
}
"""The files that are made from a template, with the name of the block for NAME."""
_XCP_TEMPLATES = {
    "NAME.a2l": "c_only.a2l.in",
    "NAME_xcp.h": "c_only_xcp.h.in",
    "xcp_main.c": "c_only_xcp_main.c.in",
}
"""Those for a master of XCP."""
_KINDS: dict[type[Scalar], Kind] = {float: "Real", int: "Integer", bool: "Boolean"}


def c_only(model: Model, a2l: bool = False) -> dict[str, bytes]:
    """Return the files of a single block in C, by name.

    NAME.h and NAME.c; NAME_text.c, with the words for why something is refused; main.c, an
    example; and what they include. With `a2l` also NAME.a2l, NAME_xcp.h and xcp_main.c,
    by which a master of XCP measures and calibrates the block.

    UntranslatableError, one line, where the block holds what cannot be translated.
    """
    name, variables = model.description.name, model.description.variables
    block = translated(name, model.block, model.file)
    groups = _groups(name, variables)
    starts: dict[str, Value] = {v.name: v.start for v in variables if v.start is not None}
    descriptions = {v.name: v.description for v in variables}
    libm = called_of_libm(block)
    state_size = _state_size(block)
    texts = {
        "name": name,
        "summary": comment_text(model.description.summary),
        "libm": ", ".join(libm) or "nothing",
        "structs": structs(groups, _MEANINGS, starts, descriptions),
        "state_size": str(state_size),
        **_copying(*groups),
        **_example(name, libm, groups[-1]),
    }
    files = {"block.h": block}
    helpers, templates = [*HELPERS], {**_TEMPLATES}
    if a2l:
        memory = layout(groups, variables, state_size)
        texts |= xcp_texts(name, memory) | a2l_texts(name, model.description.summary, memory)
        helpers += XCP_HELPERS
        templates |= _XCP_TEMPLATES
    for file in helpers:
        files[file] = (FOLDER / "c" / file).read_text("utf-8")
    for file, template in templates.items():
        files[file.replace("NAME", name)] = _filled(FOLDER / template, texts)
    return {file: text.encode() for file, text in files.items()}


def _groups(name: str, variables: Sequence[Variable]) -> list[Group]:
    """Return the inputs, the parameters and the outputs of a block, with their names in C."""
    links = (LinkVariable(v.name, _KINDS[v.kind], v.causality, v.unit or None) for v in variables)
    signature = Signature(tuple(links))
    return [Group(name, c, f"{name}_{c.title()}s", members(signature, c)) for c in ORDER]


def _state_size(block: str) -> int:
    """Return how many numbers a state in C has; 1 for none, as C has no empty array."""
    size = re.search(r"N_STATE = (\d+)", block)
    assert size is not None  # noqa: S101 - the translator writes it
    return max(1, int(size[1]))


def _copying(inputs: Group, parameters: Group, outputs: Group) -> dict[str, str]:
    """Return the C that copies structs to the block's values and back, by placeholder.

    The values are in the order of their references: inputs, outputs, parameters.
    """
    first_parameter = len(inputs.members) + len(outputs.members)
    bodies = {
        "get_inputs": lines_of(inputs, "    v[{i}] = u->{name}{number};", "(void)u, (void)v;"),
        "get_parameters": lines_of(
            parameters, "    v[{i}] = p->{name}{number};", "(void)p, (void)v;", first_parameter
        ),
        "put_outputs": lines_of(outputs, "    y->{name} = v[{i}]{truth};", "(void)v, (void)y;"),
    }
    return {function: "\n".join(lines) for function, lines in bodies.items()}


def _example(name: str, libm: Sequence[str], outputs: Group) -> dict[str, str]:
    """Return what main.c has of a block, by placeholder: the command for it, and what it prints."""
    flags = [*BITS, *(f"-fno-builtin-{function}" for function in libm if function in LIBM)]
    return {
        "command": _command(flags, name, "main.c", name),
        "xcp_command": _command(flags, f"xcp_{name}", "xcp_main.c", name),
        "format": " %.17g" * len(outputs.members),
        "arguments": "".join(f", (double)y->{member}" for _, member in outputs.members),
    }


def _command(flags: Sequence[str], program: str, main: str, name: str) -> str:
    return f"cc {' '.join(flags)} -o {program} {main} {name}.c {name}_text.c -lm"


def write_c(folder: Path, model: Model, a2l: bool = False) -> list[Path]:
    """Write the files of c_only() into a folder; return them."""
    files = {folder / name: data for name, data in sorted(c_only(model, a2l).items())}
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
