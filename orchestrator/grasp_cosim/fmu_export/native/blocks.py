"""A block as one text of C: what the slave calls under fixed names, and all that it needs."""

import re
from collections.abc import Iterator
from dataclasses import fields as dataclass_fields
from dataclasses import is_dataclass
from pathlib import Path
from types import FunctionType
from typing import Any

from ..contract import Field, declared, input_check, longest_step, variables
from .statements import Check, translated_function
from .text import UntranslatableError, comment, identifier, number, string, wrapped
from .types import BOOLEAN, REAL, SCALARS, Function, Program, Type, fields, in_words, parts

HEAD = """\
{title}
#ifndef BLOCK_H
#define BLOCK_H

#include "arithmetic.h"
#include "variable.h"
"""

PXU = "const BlockParams *p, const BlockState *x, const BlockInputs *u"


def translated(name: str, block: Any, file: Path | None = None) -> str:
    """The text of block.h; `file` is the source of a user's block.

    UntranslatableError, one line with the file and the line in it, for what is not in the subset.
    """
    program = Program(block.Params, file)
    try:
        return "\n".join(_parts_of(program, name, block))
    except TypeError as error:
        raise UntranslatableError(f"{file or name}: {error}") from error


def _parts_of(program: Program, name: str, block: Any) -> Iterator[str]:
    p, u = block.Params, block.Inputs
    first = _part(program, block, "initial_state", [p, u])
    x = first.returns
    step = _part(program, block, "step", [p, x, u, REAL], x)
    evaluate = _part(program, block, "outputs", [p, x, u], block.Outputs)
    checks = [*_checks(program, block.Params, "p")]
    input_checks = [*_input_checks(program, block)]
    scalars = [*_scalars(program, x, "x->")]
    described = declared(block)
    types: dict[str, Type] = {"Params": p, "Inputs": u, "State": x}
    types["Outputs"] = evaluate.returns
    yield HEAD.format(title=comment(f"{name}: {block.__doc__ or ''}"))
    yield _table(block, described, len(scalars))
    aliases = "".join(f"typedef {program.c(t)} Block{kind};\n" for kind, t in types.items())
    yield from (program.structs(), "".join(program.constants.values()), *program.bodies, aliases)
    yield from _conversions(program, described)
    yield _function("int block_check(const BlockParams *p, Text *why)", [*checks, "return 1;"])
    head = "int block_check_inputs(const BlockParams *p, const BlockInputs *u, Text *why)"
    yield _function(head, [*input_checks, "return 1;"])
    head = "void block_initial_state(const BlockParams *p, const BlockInputs *u, BlockState *x)"
    yield _function(head, [f"*x = {_call(first, 'pu')};"])
    head = f"void block_step({PXU}, double h, BlockState *after)"
    yield _function(head, [f"*after = {_call(step, 'pxuh')};"])
    head = f"void block_outputs({PXU}, BlockOutputs *y)"
    yield _function(head, [f"*y = {_call(evaluate, 'pxu')};"])
    truth = [" != 0.0" if kind == BOOLEAN else "" for _, kind in scalars]
    save = [f"numbers[{i}] = {path};" for i, (path, _) in enumerate(scalars)]
    load = [f"{path} = numbers[{i}]{truth[i]};" for i, (path, _) in enumerate(scalars)]
    yield _function("void block_save(const BlockState *x, double *numbers)", save)
    yield _function("void block_load(const double *numbers, BlockState *x)", load)
    yield "#endif\n"


def _part(
    program: Program, block: Any, name: str, types: list[Type], must: Type | None = None
) -> Function:
    function = getattr(block, name)
    code = function.__code__
    source = program.source(code.co_filename)
    if code.co_argcount != len(types):
        raise source.error(code.co_firstlineno, f"{name}: must have {len(types)} parameters")
    translated = translated_function(program, function, types)
    if must is not None and translated.returns != must:
        reason = f"{name}: returns {in_words(translated.returns)}; must be {in_words(must)}"
        raise source.error(code.co_firstlineno, reason)
    return translated


def _call(function: Function, names: str) -> str:
    arguments = zip(names, function.by_address, strict=True)
    return f"{function.name}({', '.join(n if b or n in 'ph' else f'*{n}' for n, b in arguments)})"


def _function(head: str, lines: list[str]) -> str:
    names = re.findall(r"(\w+)[,)]", head)
    text = " ".join(lines)
    unused = [f"(void){name};" for name in names if not re.search(rf"\b{name}\b", text)]
    body = "".join(f"{wrapped(f'    {line}')}\n" for line in [*unused, *lines])
    return f"{wrapped(f'static inline {head}')}\n{{\n{body}}}\n"


def _table(block: Any, described: list[Field], states: int) -> str:
    """The variables: inputs, outputs, parameters; value references are places in this table."""
    scalars = variables(described)
    kinds = ("input", "output", "parameter")
    counts = {f"{kind}s": sum(v.causality == kind for v in scalars) for kind in kinds}
    counts |= {"state": states, "variables": len(scalars)}
    rows = []
    for v in scalars:
        kind = "INTEGER" if v.enumeration else v.type.upper()
        cells = [string(v.name), string(v.in_unit), f"KIND_{kind}", v.causality.upper()]
        limited = "INFINITE" if v.infinite else str(int(v.limits is not None))
        cells += [str(int(v.variability == "fixed")), limited]
        cells += map(number, (*(v.limits or (0.0, 0.0)), float(v.start or 0.0)))
        rows.append(f"    {{{', '.join(cells)}}},\n")
    return (
        f"enum {{ {', '.join(f'N_{kind.upper()} = {n}' for kind, n in counts.items())} }};\n\n"
        f"#define BLOCK_LONGEST_STEP {number(longest_step(block))} /* s */\n\n"
        f"static const Variable variables[N_VARIABLES + 1] = {{\n{''.join(rows)}}};\n"
    )


def _conversions(program: Program, described: list[Field]) -> Iterator[str]:
    """Params and Inputs from the values of the variables, and the values of outputs."""
    params, inputs, outputs = list[str](), list[str](), list[str]()
    for f in described:
        path = ".".join(map(identifier, f.name.split(".")))
        truth = " != 0.0" if f.kind is bool else ""
        for member in [path] if f.size is None else [f"{path}.at[{i}]" for i in range(f.size)]:
            value = f"values[{len(inputs) + len(params) + len(outputs)}]{truth}"
            if f.causality == "output":
                outputs.append(f"values[{len(outputs)}] = y->{member};")
            elif f.causality == "input":
                inputs.append(f"u->{member} = {value};")
            else:
                params.append(f"p->{member} = {value};")
    params += [
        f"p->{identifier(name)} = {prop.name}(p);"
        for name, prop in program.cached_properties.items()
    ]
    yield _function("void block_params(const double *values, BlockParams *p)", params)
    yield _function("void block_inputs(const double *values, BlockInputs *u)", inputs)
    yield _function("void block_outputs_to(const BlockOutputs *y, double *values)", outputs)


def _checks(program: Program, cls: type[Any], path: str) -> Iterator[str]:
    """What says no where parameters do not go together: what is inside comes before."""
    for f in dataclass_fields(cls):
        kind = fields(cls)[f.name]
        if is_dataclass(kind):
            arrow = "->" if path == "p" else "."
            yield from _checks(program, kind, f"{path}{arrow}{identifier(f.name)}")
    for owner in reversed(cls.__mro__):
        check = owner.__dict__.get("__post_init__")
        if isinstance(check, FunctionType) and check.__module__ != "block_variables":
            name = program.unique(check.__module__, f"{owner.__name__}_check", (check, cls))
            text = Check(program, check).definition(name, [cls])
            if text:
                program.bodies.append(text)
                of = path if path == "p" else f"&{path}"
                yield f"if (!{name}({of}, why)) {{\n        return 0;\n    }}"


def _input_checks(program: Program, block: Any) -> Iterator[str]:
    """What says no where the block refuses its inputs."""
    check = input_check(block)
    if check is not None:
        name = program.unique(check.__module__, check.__name__, (check, block.Params))
        body = Check(program, check)
        text = body.definition(name, [block.Params, block.Inputs])
        program.bodies.append(text)
        u = "u" if body.by_address[1] else "*u"
        yield f"if (!{name}(p, {u}, why)) {{\n        return 0;\n    }}"


def _scalars(program: Program, t: Type, path: str) -> Iterator[tuple[str, Type]]:
    """The numbers in a state, in the order of declaration."""
    if t in SCALARS:
        yield "*x" if path == "x->" else path, t
    for i, kind in enumerate(parts(t)):
        yield from _scalars(program, kind, (path + program.member(t, i)).replace("->.", "->"))
