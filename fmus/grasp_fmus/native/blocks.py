# ruff: noqa: E501, S101
# mypy: disable-error-code="union-attr, arg-type, attr-defined, str-bytes-safe"
"""block.h: a block in C, as the slave calls it."""

from collections.abc import Iterator
from dataclasses import fields as dataclass_fields
from pathlib import Path
from types import FunctionType
from typing import Any

from ..contract import Field, declared, longest_step, variables
from . import statements
from .structs import Function, Program
from .text import UntranslatableError, comment, identifier, number, string, wrapped
from .types import (
    BOOLEAN,
    NUMBER,
    REAL,
    WHOLE,
    Group,
    Member,
    Record,
    Tuple,
    Type,
    Value,
    fields,
    said,
)

__all__ = ["UntranslatableError", "translated"]

KINDS = {float: "KIND_REAL", bool: "KIND_BOOLEAN", int: "KIND_INTEGER"}

_FRAME = """\
{about}#ifndef BLOCK_H
#define BLOCK_H

#include "arithmetic.h"
#include "variable.h"

/* Types and constants */

{definitions}
/* Functions */

{functions}
/* As the slave calls it */

{seam}
#endif
"""

_CALLS = """\
static inline void block_initial_state(const BlockParams *p, const BlockInputs *u, BlockState *x)
{{
    *x = {initial_state};
}}

static inline void block_step(
    const BlockParams *p, const BlockState *x, const BlockInputs *u, double h, BlockState *after)
{{
    *after = {step};
}}

static inline void block_outputs(
    const BlockParams *p, const BlockState *x, const BlockInputs *u, BlockOutputs *y)
{{
    *y = {outputs};
}}
"""


def translated(name: str, block: Any, file: Path | None = None) -> str:
    """The block in C: the text of block.h.

    `file` is the source of a block module that has no __file__ of its own. UntranslatableError, one
    line, where the block has something that is not in the subset.
    """
    program = Program(block, file)
    if program.own is None:
        raise UntranslatableError(f"{file or block.__name__}: line 1: must be a Python file")
    params, inputs, outputs = Group(block.Params), Record(block.Inputs), Record(block.Outputs)
    p, u = Value("p", params), Value("*u", inputs, 8)
    first = _part(program, "initial_state", [p, u])
    x = Value("*x", first.returns, 8)
    after = _part(program, "step", [p, x, u, Value("h", REAL)], first.returns)
    seen = _part(program, "outputs", [p, x, u], outputs)
    described = declared(block)
    scalars = list(_scalars(program, first.returns, "x"))
    seam = [
        _table(name, block, described, len(scalars)),
        "".join(
            f"typedef {program.c(t)} {called};\n"
            for t, called in (
                (params, "BlockParams"),
                (inputs, "BlockInputs"),
                (first.returns, "BlockState"),
                (outputs, "BlockOutputs"),
            )
        ),
        _conversions(program, block, described),
        _check(program, params),
        _CALLS.format(
            initial_state=_call(first, "p, *u"),
            step=_call(after, "p, *x, *u, h"),
            outputs=_call(seen, "p, *x, *u"),
        ),
        _states(scalars),
    ]
    return _FRAME.format(
        about=comment(f"{name}: the block in C. Made from {program.own.file.name}, do not edit."),
        definitions="\n".join([program.structs(), program.constants()]),
        functions="\n".join(program.bodies),
        seam="\n".join(seam),
    )


def _part(
    program: Program, name: str, arguments: list[Value], must: Type | None = None
) -> Function:
    function = getattr(program.block, name)
    function = getattr(function, "__wrapped__", function)
    assert program.own
    line = getattr(getattr(function, "__code__", None), "co_firstlineno", 1)
    if not isinstance(function, FunctionType) or function.__code__.co_argcount != len(arguments):
        raise program.own.error(
            line, f"{name}: must be a function with {len(arguments)} parameters"
        )
    made = statements.function(program, function, arguments)
    if must and made.returns != must:
        raise program.own.error(line, f"{name}: returns {said(made.returns)}; must be {said(must)}")
    return made


def _call(made: Function, arguments: str) -> str:
    return f"{made.name}({arguments})"


def _function(head: str, lines: list[str], names: str) -> str:
    """A function of the seam; names are those of its parameters, used or not."""
    quiet = "".join(f"    (void){name};\n" for name in names.split() if not lines)
    return wrapped(f"static inline {head}") + "\n{\n" + quiet + "".join(lines) + "}\n"


def _table(name: str, block: Any, described: list[Field], states: int) -> str:
    found = variables(described)
    counts = [sum(v.causality == c for v in found) for c in ("input", "output", "parameter")]
    names = ("N_INPUTS", "N_OUTPUTS", "N_PARAMETERS", "N_VARIABLES", "N_STATE")
    counted = zip(names, [*counts, sum(counts), states], strict=True)
    rows = []
    for v in found:
        low, high = v.limits or (0.0, 0.0)
        start = 0.0 if v.start is None else float(v.start)
        numbers = ", ".join(number(float(x)) for x in (low, high, start))
        rows.append(
            f"    {{{string(v.name)}, {string(v.in_unit)}, {KINDS[v.kind]}, {v.causality.upper()},\n"
            f"     {int(v.variability == 'fixed')}, {int(v.limits is not None)}, {numbers}}},\n"
        )
    return (
        f"#define BLOCK_NAME {string(name)}\n"
        f"#define BLOCK_LONGEST_STEP {number(longest_step(block))} /* s */\n\n"
        f"enum {{ {', '.join(f'{n} = {count}' for n, count in counted)} }};\n\n"
        f"static const Variable variables[N_VARIABLES] = {{\n{''.join(rows)}}};\n"
    )


def _conversions(program: Program, block: Any, described: list[Field]) -> str:
    """From the values of all variables, in their order, to the structs, and back."""
    roots: dict[str, Type] = {
        "input": Record(block.Inputs),
        "output": Record(block.Outputs),
        "parameter": Group(block.Params),
    }
    lines: dict[str, list[str]] = {causality: [] for causality in roots}
    count = 0
    for f in described:
        kind: Any = roots[f.causality]
        for part in f.path:
            kind = fields(kind)[part]
        path = f"{f.causality[0]}->".replace("i", "u").replace("o", "y")
        path += ".".join(identifier(n) for n in f.path)
        for i in range(f.size or 1):
            item = path if f.size is None else f"{path}.at[{i}]"
            scalar = kind.items[i] if isinstance(kind, Tuple) else kind
            if f.causality == "output":
                line = f"    values[{len(lines['output'])}] = {item};\n"
            else:
                line = f"    {item} = values[{count}]{' != 0.0' if scalar == BOOLEAN else ''};\n"
            lines[f.causality].append(line)
            count += 1
    lines["parameter"] += _kept(program, Group(block.Params), "p")
    return "\n".join(
        [
            _function(
                "void block_params(const double *values, BlockParams *p)",
                lines["parameter"],
                "values p",
            ),
            _function(
                "void block_inputs(const double *values, BlockInputs *u)",
                lines["input"],
                "values u",
            ),
            _function(
                "void block_outputs_to(const BlockOutputs *y, double *values)",
                lines["output"],
                "y values",
            ),
        ]
    )


def _kept(program: Program, t: Group, path: str) -> Iterator[str]:
    """What is worked out of the parameters, those inside first."""
    arrow = "->" if path == "p" else "."
    for name, kind in fields(t).items():
        if isinstance(kind, Group):
            yield from _kept(program, kind, f"{path}{arrow}{identifier(name)}")
    for name, made in program.kept.get(t.cls, {}).items():
        given = path if path == "p" else f"&{path}"
        yield f"    {path}{arrow}{identifier(name)} = {made.name}({given});\n"


def _check(program: Program, params: Group) -> str:
    lines = [
        f"    if (!{made.name}({path}, why)) {{\n        return 0;\n    }}\n"
        for made, path in _checks(program, params, "p")
    ]
    quiet = "" if lines else "    (void)p;\n    (void)why;\n"
    text = f"{quiet}{''.join(lines)}    return 1;\n"
    return _function("int block_check(const BlockParams *p, Text *why)", [text], "")


def _checks(program: Program, t: Group, path: str) -> Iterator[tuple[Function, str]]:
    """The checks of what is inside come before."""
    plain = path.removeprefix("&")
    for f in dataclass_fields(t.cls):
        kind = fields(t)[f.name]
        if isinstance(kind, Group):
            arrow = "->" if path == "p" else "."
            yield from _checks(program, kind, f"&{plain}{arrow}{identifier(f.name)}")
    found = getattr(t.cls, "__post_init__", None)
    made = statements.check(program, found, t) if isinstance(found, FunctionType) else None
    if made:
        yield made, path


def _scalars(program: Program, t: Type, path: str) -> Iterator[tuple[str, Type]]:
    """The scalars of a state with their paths in C."""
    arrow = "->" if path == "x" else "."
    if isinstance(t, Record):
        for name, kind in fields(t).items():
            if kind:
                yield from _scalars(program, kind, f"{path}{arrow}{identifier(name)}")
    elif isinstance(t, Tuple):
        place = "at[{}]" if t.is_array else "at_{}"
        for i, kind in enumerate(t.items):
            yield from _scalars(program, kind, f"{path}{arrow}{place.format(i)}")
    elif t == NUMBER or isinstance(t, Group):
        assert program.own
        raise program.own.error(
            1, f"the state has {said(t)} in it; must be float, bool, int, and tuples of them"
        )
    else:
        yield ("*x" if path == "x" else path), t


def _states(scalars: list[tuple[str, Type]]) -> str:
    save = [f"    numbers[{i}] = {path};\n" for i, (path, _) in enumerate(scalars)]
    load = []
    for i, (path, t) in enumerate(scalars):
        value = (
            f"truncated(numbers[{i}])" if t == WHOLE or isinstance(t, Member) else f"numbers[{i}]"
        )
        load.append(f"    {path} = {value}{' != 0.0' if t == BOOLEAN else ''};\n")
    return "\n".join(
        [
            _function("void block_save(const BlockState *x, double *numbers)", save, "x numbers"),
            _function("void block_load(const double *numbers, BlockState *x)", load, "numbers x"),
        ]
    )
