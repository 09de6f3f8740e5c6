"""block.h: a block as the slave calls it, whatever its names are."""

from collections.abc import Iterator
from dataclasses import fields
from math import inf
from types import FunctionType
from typing import Any

from ...contract import Field, declared, longest_step, variables
from . import names
from .layout import wrapped
from .program import Function, Key, Program
from .python_source import UntranslatableError
from .shapes import BOOLEAN, NUMBERS, REAL, WHOLE, Group, Member, Record, Tuple, Type, fits, said
from .statements import function

KINDS = {float: "KIND_REAL", bool: "KIND_BOOLEAN", int: "KIND_INTEGER"}


VARIABLE = '#include "variable.h"\n\n'
"""Before the table of variables."""


def block_header(program: Program, name: str, block: Any) -> tuple[str, set[Key]]:
    """The text of block.h without its includes, and what it needs."""
    program.needed = set()
    needed = program.needed
    params, inputs, outputs = Group(block.Params), Record(block.Inputs), Record(block.Outputs)
    first = _part(program, block, "initial_state", [params, inputs])
    state = first.returns
    step = _part(program, block, "step", [params, state, inputs, REAL])
    evaluate = _part(program, block, "outputs", [params, state, inputs])
    if not fits(step.returns, state):
        raise _error(
            program,
            block,
            "step",
            f"returns {said(step.returns)}; must be {said(state)}, as initial_state",
        )
    if evaluate.returns != outputs:
        raise _error(
            program, block, "outputs", f"returns {said(evaluate.returns)}; must be Outputs"
        )
    checks = list(_checks(program, block.Params, "p"))
    described = declared(block)
    scalars = list(_scalars(program, state, "x"))
    parts = [
        _table(name, described, len(scalars), longest_step(block)),
        f"typedef {program.shape(params)} BlockParams;\n"
        f"typedef {program.shape(inputs)} BlockInputs;\n"
        f"typedef {program.shape(state)} BlockState;\n"
        f"typedef {program.shape(outputs)} BlockOutputs;\n",
        _conversions(program, block, described),
        _check(checks),
        _states(scalars),
        _functions(first, step, evaluate),
    ]
    return "\n".join(parts), needed


def _part(program: Program, block: Any, name: str, arguments: list[Type]) -> Function:
    of = getattr(block, name)
    of = getattr(of, "__wrapped__", of)
    if not isinstance(of, FunctionType):
        raise _error(program, block, name, "must be a function")
    if of.__code__.co_argcount != len(arguments):
        raise _error(program, block, name, f"must have {len(arguments)} parameters")
    return function(program, of, arguments, _error(program, block, name, ""))


def _error(program: Program, block: Any, name: str, reason: str) -> UntranslatableError:
    line = getattr(getattr(getattr(block, name, None), "__code__", None), "co_firstlineno", 1)
    return UntranslatableError(f"{program.sources.block_file}: line {line}: {name}: {reason}")


def _checks(program: Program, cls: type[Any], path: str) -> Iterator[str]:
    """The checks in the order in which the classes are made: what is inside comes before."""
    members = program.members(Group(cls))
    for f in fields(cls):
        kind = members[f.name]
        if isinstance(kind, Group):
            arrow = "->" if path == "p" else "."
            yield from _checks(program, kind.cls, f"{path}{arrow}{names.identifier(f.name)}")
        if isinstance(kind, Member):
            arrow = "->" if path == "p" else "."
            yield _member_check(kind, f"{path}{arrow}{names.identifier(f.name)}")
    check = getattr(cls, "__post_init__", None)
    if isinstance(check, FunctionType) and check.__module__ != "block_variables":
        where = program.home(cls).error(1, "")
        made = function(program, check, [Group(cls)], where)
        if made.faults:
            yield f"    {made.name}({path if path == 'p' else f'&{path}'}, fault);\n"
        else:
            program.needed.discard(made.key)


def _member_check(t: Member, path: str) -> str:
    """That a number in the range of an enumeration is one of its members; nothing without gaps."""
    found = sorted(int(m) for m in t.enum)
    if found == list(range(found[0], found[-1] + 1)):
        return ""
    is_none = " && ".join(f"{path} != {names.whole(m)}" for m in found)
    said_ = names.string(f" is not a valid {t.enum.__qualname__}")
    return (
        "\n".join(wrapped(f'    if ({is_none} && py_raise(fault, FAULT_VALUE, "ValueError")) {{'))
        + f"\n        py_say_whole(fault, {path});\n        py_say(fault, {said_});\n    }}\n"
    )


def _check(checks: list[str]) -> str:
    text = "".join(checks) or "    (void)p;\n    (void)fault;\n"
    return _function("static void block_check(const BlockParams *p, Fault *fault)", text)


def _function(head: str, body: str) -> str:
    return f"{head}\n{{\n{body}}}\n"


def _table(name: str, described: list[Field], states: int, longest: float) -> str:
    found = variables(described)
    counts = [sum(v.causality == c for v in found) for c in ("input", "output", "parameter")]
    rows = []
    for v in found:
        low, high = v.limits or (0.0, 0.0)
        start = 0.0 if v.start is None else float(v.start)
        rows.append(
            f"    {{{names.string(v.name)}, {names.string(v.in_unit)}, {KINDS[v.kind]}, "
            f"{v.causality.upper()}, {int(v.variability == 'fixed')},\n"
            f"     {int(v.limits is not None)}, "
            f"{', '.join(names.real(float(x)) for x in (low, high, start))}}},\n"
        )
    defined = {
        "BLOCK_NAME": names.string(name),
        "N_INPUTS": counts[0],
        "N_OUTPUTS": counts[1],
        "N_PARAMETERS": counts[2],
        "N_VARIABLES": "(N_INPUTS + N_OUTPUTS + N_PARAMETERS)",
        "N_STATE": states,
        "BLOCK_LONGEST_STEP": "HUGE_VAL" if longest == inf else names.real(longest),
    }
    return (
        "".join(f"#define {n} {v}\n" for n, v in defined.items())
        + f"{VARIABLE}static const Variable variables[N_VARIABLES] = {{\n{''.join(rows)}}};\n"
    )


def _conversions(program: Program, block: Any, described: list[Field]) -> str:
    texts: dict[str, list[str]] = {"input": [], "output": [], "parameter": []}
    places = {"input": 0, "output": 0, "parameter": 0}
    count = 0
    for f in described:
        root = {
            "input": Record(block.Inputs),
            "output": Record(block.Outputs),
            "parameter": Group(block.Params),
        }[f.causality]
        kind = _kind_at(program, root, f.path)
        holder = {"input": "u", "output": "y", "parameter": "p"}[f.causality]
        path = f"{holder}->" + ".".join(names.identifier(n) for n in f.path)
        for i in range(f.size or 1):
            item = path if f.size is None else f"{path}.at[{i}]"
            scalar = kind.items[i] if isinstance(kind, Tuple) else kind
            place = count if f.causality != "output" else places["output"]
            value = f"v[{place}] != 0.0" if scalar == BOOLEAN else f"v[{place}]"
            texts[f.causality].append(
                f"    v[{place}] = {item};\n"
                if f.causality == "output"
                else f"    {item} = {value};\n"
            )
            places[f.causality] += 1
            count += 1
    heads = {
        "parameter": "static void block_params(const double v[N_VARIABLES], BlockParams *p)",
        "input": "static void block_inputs(const double v[N_VARIABLES], BlockInputs *u)",
        "output": "static void block_outputs_to(const BlockOutputs *y, double v[N_OUTPUTS])",
    }
    none = {
        c: f"    (void)v;\n    (void){h};\n"
        for c, h in (("input", "u"), ("output", "y"), ("parameter", "p"))
    }
    return "\n".join(_function(heads[c], "".join(texts[c]) or none[c]) for c in heads)


def _kind_at(program: Program, t: Any, path: tuple[str, ...]) -> Type:
    for name in path:
        t = program.members(t)[name]
    return t  # type: ignore[no-any-return]


def _scalars(program: Program, t: Type, path: str) -> Iterator[tuple[str, Type]]:
    """The scalars of a state with their paths in C."""
    arrow = "->" if path == "x" else "."
    if isinstance(t, Record):
        for name, kind in program.members(t).items():
            yield from _scalars(program, kind, f"{path}{arrow}{names.identifier(name)}")
    elif isinstance(t, Tuple):
        array = program.is_array(t)
        for i, kind in enumerate(t.items):
            yield from _scalars(program, kind, f"{path}{arrow}{f'at[{i}]' if array else f'at_{i}'}")
    elif t in (REAL, WHOLE, BOOLEAN):
        yield ("*x" if path == "x" else path), t
    else:
        fix = "; write 0.0 for 0, or float(...)" if t in NUMBERS else ""
        raise UntranslatableError(
            f"{program.sources.block_file}: line 1: the state has {said(t)} in it; must be float, "
            f"bool, int, and tuples of them, each of one type{fix}"
        )


def _states(scalars: list[tuple[str, Type]]) -> str:
    save, load = "", ""
    for i, (path, t) in enumerate(scalars):
        save += f"    numbers[{i}] = {path};\n"
        value = f"numbers[{i}]"
        value = f"py_int({value}, fault)" if t == WHOLE else value
        load += f"    {path} = {value}{' != 0.0' if t == BOOLEAN else ''};\n"
    none = "    (void)x;\n    (void)numbers;\n" if not scalars else ""
    quiet = "" if any(t == WHOLE for _, t in scalars) else "    (void)fault;\n"
    return (
        _function("static void block_save(const BlockState *x, double numbers[])", save + none)
        + "\n"
        + _function(
            "static void block_load(const double numbers[], BlockState *x, Fault *fault)",
            load + none + quiet,
        )
    )


def _functions(first: Function, step: Function, evaluate: Function) -> str:
    head = "const BlockParams *p, const BlockState *x, const BlockInputs *u"
    texts = [
        (
            "static void block_initial_state(\n    const BlockParams *p, const BlockInputs *u, "
            "BlockState *x, Fault *fault)",
            f"*x = {_call(first, 'p, *u')}",
            first,
        ),
        (
            f"static void block_step(\n    {head}, double h,\n    BlockState *after, Fault *fault)",
            f"*after = {_call(step, 'p, *x, *u, h')}",
            step,
        ),
        (
            f"static void block_outputs(\n    {head}, BlockOutputs *y,\n    Fault *fault)",
            f"*y = {_call(evaluate, 'p, *x, *u')}",
            evaluate,
        ),
    ]
    return "\n".join(_function(h, _quiet(f) + f"    {text};\n") for h, text, f in texts)


def _call(f: Function, arguments: str) -> str:
    return f"{f.name}({arguments}{', fault' if f.faults else ''})"


def _quiet(f: Function) -> str:
    return "" if f.faults else "    (void)fault;\n"
