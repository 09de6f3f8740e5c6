"""Writes the C of a block alone, for real-time targets: no FMI, no allocation, no stdio.

c_only.h.in and c_only.c.in are its header and its code, for a block called Model; here they get the
name and the variables. Members are called as in the C header of a proxy (c_header.py), so that the
structs of both are the same.
"""

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from string import Template

from c_compilers import BITS, LIBM

from ..c_header import Group, Member, comment, members, structs
from ..fmu import Model
from ..folder import write_file
from ..link.message import Value
from ..link.signature import ORDER, Causality, Kind, LinkVariable, Signature
from ..variable import Scalar, Variable
from .old.translation import translated

FOLDER = Path(__file__).parent
HELPERS = ("python_arithmetic.h", "number_text.h", "variable.h")
"""What the C of a block includes, from the folder c."""

EXACT = frozenset({"ceil", "copysign", "fabs", "floor", "sqrt"})
"""Functions of libm whose results IEEE 754 fixes: every compiler may work them out."""

_MEANINGS: dict[Causality, str] = {
    "input": "What the block gets with every step; held meanwhile",
    "parameter": "What it is set up with",
    "output": "What it gives",
}
_KINDS: dict[type[Scalar], Kind] = {float: "Real", int: "Integer", bool: "Boolean"}
_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_FUNCTION = re.compile(
    r"^static [^;{}#]*?\b(\w+)\([^;{}]*\)\s*\{([^\n]*\}$|.*?^\})", re.MULTILINE | re.DOTALL
)
"""A function with its name and body, which ends on its line, or with a brace that begins one."""


def c_only(model: Model) -> dict[str, bytes]:
    """Return the files of a block alone in C, by name: NAME.h, NAME.c, main.c, what they include.

    UntranslatableError, one line, where the block holds what cannot be translated.
    """
    name, variables = model.description.name, model.description.variables
    included = translated(name, model.block, model.file)
    included |= {file: (FOLDER / "c" / file).read_text("utf-8") for file in HELPERS}
    libm = called_of_libm(included.values())
    signature = Signature(tuple(map(_link_variable, variables)))
    groups = [Group(name, c, f"{name}_{c.title()}s", *members(signature, c)) for c in ORDER]
    places = {v.name: i for i, v in enumerate(variables)}
    inputs, parameters, outputs = ([*group.members] for group in groups)
    flags = (*BITS, *(f"-fno-builtin-{f}" for f in libm if f in LIBM))
    starts: dict[str, Value] = {v.name: v.start for v in variables if v.start is not None}
    texts = {
        "name": name,
        "summary": comment(model.description.summary),
        "libm": ", ".join(libm) or "nothing",
        "structs": structs(groups, _MEANINGS, starts, {v.name: v.description for v in variables}),
        "state_size": str(max(1, _state_size(included["block.h"]))),
        "get_inputs": _body([_got(m, "u", places) for m in inputs], "u, (void)v"),
        "get_parameters": _body([_got(m, "p", places) for m in parameters], "p, (void)v"),
        "put_outputs": _body([_put(m, i) for i, m in enumerate(outputs)], "v, (void)y"),
        "command": f"cc {' '.join(flags)} -o {name} main.c {name}.c -lm",
        "format": " %.17g" * len(outputs),
        "arguments": "".join(f", (double)y->{m.identifier}" for m in outputs),
    }
    files = {f"{name}.h": "c_only.h.in", f"{name}.c": "c_only.c.in", "main.c": "c_only_main.c.in"}
    written = {file: _filled(FOLDER / template, texts) for file, template in files.items()}
    return {file: text.encode() for file, text in {**included, **written}.items()}


def write_c(folder: Path, model: Model) -> list[Path]:
    """Write the files of c_only() into a folder; return them."""
    files = {folder / name: data for name, data in sorted(c_only(model).items())}
    for path, data in files.items():
        write_file(path, data)
    return [*files]


def called_of_libm(texts: Iterable[str]) -> list[str]:
    """Return the functions of libm that the functions in texts called block_... reach, sorted."""
    known = {*LIBM, *EXACT}
    plain = (_COMMENT.sub("", text) for text in texts)
    bodies = {name: body for text in plain for name, body in _FUNCTION.findall(text)}
    waiting = [name for name in bodies if name.startswith("block_")]
    found: set[str] = set()
    while waiting:
        for name in re.findall(r"\w+(?=\()", bodies[waiting.pop()]):
            if name not in found and (name in known or name in bodies):
                found.add(name)
                waiting += [name] if name in bodies else []
    return sorted(found & known)


def _link_variable(v: Variable) -> LinkVariable:
    return LinkVariable(v.name, _KINDS[v.kind], v.causality, v.unit or None)


def _state_size(block: str) -> int:
    found = re.search(r"^#define N_STATE (\d+)", block, re.MULTILINE)
    if found is None:
        raise ValueError("block.h: must have #define N_STATE")
    return int(found[1])


def _got(m: Member, struct: str, places: Mapping[str, int]) -> str:
    value = f"{struct}->{m.identifier}"
    value = {"Boolean": f"{value} ? 1.0 : 0.0", "Integer": f"(double){value}"}.get(
        m.variable.kind, value
    )
    return f"v[{places[m.variable.name]}] = {value};"


def _put(m: Member, place: int) -> str:
    value = f"v[{place}] != 0.0" if m.variable.kind == "Boolean" else f"v[{place}]"
    return f"y->{m.identifier} = {value};"


def _body(lines: list[str], unused: str) -> str:
    """Return the lines of a function; of one without any, those of its arguments."""
    return "\n".join(f"    {line}" for line in lines or [f"(void){unused};"])


def _filled(template: Path, texts: Mapping[str, str]) -> str:
    name = texts["name"]
    text = re.sub(r"\bModel_", f"{name}_", template.read_text("utf-8"))
    return Template(re.sub(r"\bMODEL_", f"{name.upper()}_", text)).substitute(texts)
