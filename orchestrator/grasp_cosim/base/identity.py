"""What decides what a function returns, as hashes: its code and what it reaches.

That is its bytecode with constants and names, its defaults, what it closes over and what it reads
of its module: functions, classes and modules of the user's in turn, and values. What Python or an
installed package has counts by its name. Comments and places in a file do not count.
"""

import dis
import sys
import sysconfig
from collections.abc import Callable, Iterator
from functools import partial
from hashlib import sha256
from pathlib import Path
from types import (
    BuiltinFunctionType,
    CellType,
    CodeType,
    EllipsisType,
    FunctionType,
    MethodType,
    ModuleType,
    NoneType,
)
from typing import Any

CODE = "code"
"""The part of a function that is not named: its code and its defaults."""

_PLAIN = (bool, int, float, complex, str, bytes, NoneType, EllipsisType)

_INSTALLED = {Path(sysconfig.get_path(key)) for key in ("stdlib", "purelib", "platlib")}

_OF_A_CLASS = (FunctionType, staticmethod, classmethod, property, *_PLAIN)
"""Of what a class has, what decides what its instances do."""

_PROTOCOL = 4
"""Of pickle, by which objects say what they are made of."""


def parts_of(function: Callable[..., Any]) -> dict[str, str]:
    """The hash of each part of a function: CODE, and what it reaches by name."""
    memo: _Memo = {}
    if not isinstance(function, FunctionType):
        return {CODE: _digest(function, memo)}
    code = _joined(_digest(part, memo) for part in _code_and_defaults(function))
    return {CODE: code, **{name: _digest(v, memo) for name, v in _reached(function)}}


_Memo = dict[int, tuple[str, Any]]
"""Hashes by the id of what has them, which is kept so that its id is."""


def _digest(value: Any, memo: _Memo) -> str:
    if id(value) not in memo:
        memo[id(value)] = "begun", value  # where it leads back to itself
        parts = (p if isinstance(p, str) else _digest(p[0], memo) for p in _made_of(value))
        memo[id(value)] = _joined((type(value).__qualname__, *parts)), value
    return memo[id(value)][0]


def _joined(texts: Any) -> str:
    return sha256("\0".join(texts).encode("utf-8", "surrogatepass")).hexdigest()


def _made_of(value: Any) -> Iterator[str | tuple[Any]]:
    """Texts, and in tuples of one the values that count for a value."""
    match value:
        case bytes():
            yield sha256(value).hexdigest()
        case _ if isinstance(value, _PLAIN):
            yield repr(value)
        case list() | tuple():
            yield from ((item,) for item in value)
        case dict():
            yield from ((part,) for item in value.items() for part in item)
        case set() | frozenset():
            yield from sorted(_digest(item, {}) for item in value)
        case CodeType():
            yield value.co_code.hex()
            yield from map(repr, (value.co_names, value.co_varnames, value.co_freevars))
            yield (value.co_consts,)
        case CellType():
            yield from _contents(value)
        case ModuleType():
            yield value.__name__
            if not _is_installed(value.__name__) and (file := getattr(value, "__file__", None)):
                yield sha256(Path(file).read_bytes()).hexdigest()
        case type() | FunctionType() if _is_installed(value.__module__):
            yield f"{value.__module__}.{value.__qualname__}"
        case FunctionType():
            yield from ((part,) for part in _code_and_defaults(value))
            yield from ((part,) for item in _reached(value) for part in item)
        case type():
            yield value.__qualname__
            yield from ((base,) for base in value.__bases__)
            members = ((n, v) for n, v in sorted(vars(value).items()) if isinstance(v, _OF_A_CLASS))
            yield from ((part,) for n, v in members if not _is_noted(n) for part in (n, v))
        case MethodType():
            yield from ((value.__func__,), (value.__self__,))
        case BuiltinFunctionType():
            yield f"{value.__module__}.{value.__qualname__}"
        case staticmethod() | classmethod():
            yield (value.__func__,)
        case property():
            yield from ((value.fget,), (value.fset,))
        case partial():
            yield from ((value.func,), (value.args,), (value.keywords,))
        case _:
            yield (type(value),)
            yield from _state(value)


def _code_and_defaults(function: FunctionType) -> tuple[Any, ...]:
    return function.__code__, function.__defaults__, function.__kwdefaults__


def _reached(function: FunctionType) -> Iterator[tuple[str, Any]]:
    """What a function reads of its module and closes over, by name."""
    names = sorted({*_read(function.__code__)} & {*function.__globals__})
    yield from ((name, function.__globals__[name]) for name in names)
    cells = function.__closure__ or ()
    yield from zip(function.__code__.co_freevars, cells, strict=True)


def _read(code: CodeType) -> Iterator[str]:
    """The names of a module or of Python that a code and those in it read."""
    for operation in dis.get_instructions(code):
        if operation.opname in ("LOAD_GLOBAL", "LOAD_NAME"):
            yield operation.argval
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _read(inner)


def _contents(cell: CellType) -> Iterator[tuple[Any]]:
    try:
        yield (cell.cell_contents,)
    except ValueError:  # it is empty
        return


def _state(value: Any) -> Iterator[str | tuple[Any]]:
    """What an object says that it is made of; nothing of a lock, a file or the like."""
    try:
        reduced = value.__reduce_ex__(_PROTOCOL)
    except Exception:  # what it raises is up to it
        return
    if isinstance(reduced, str):
        yield reduced
        return
    yield from ((part,) for part in reduced[:3])
    yield from ((list(items),) for items in reduced[3:5] if items is not None)


def _is_noted(name: str) -> bool:
    """True for what Python notes of a class: where it stands, and its text."""
    return name in ("__module__", "__doc__", "__firstlineno__", "__qualname__")


def _is_installed(name: str) -> bool:
    """True for a module of Python or of an installed package."""
    if name.partition(".")[0] in sys.stdlib_module_names:
        return name != "__main__"
    file = getattr(sys.modules.get(name), "__file__", None)
    return file is not None and any(Path(file).is_relative_to(folder) for folder in _INSTALLED)
