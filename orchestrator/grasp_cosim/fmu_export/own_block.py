"""Reads a block that is a user's Python file, wherever that is, and checks that it is one.

Its documentation is its docstring and the table of its variables.
"""

import ast
import ctypes
import inspect
import re
import sys
import threading
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from dataclasses import fields
from functools import partial
from importlib.machinery import ModuleSpec, SourceFileLoader
from importlib.util import module_from_spec
from math import inf, isfinite
from pathlib import Path
from shlex import quote
from typing import Any

import block_variables

from ..base.si_units import refusal
from .contract import Variable, declared, longest_step, unpacker, variables
from .description import Description
from .package import HASH, IMPORT, Model, script
from .page import BEGIN, variable_tables
from .shipped import FEWEST, MOST, PACKAGES, SHIPPED, of_fingers, together

PARTS = ("Params", "Inputs", "State", "Outputs", "initial_state", "step", "outputs")
"""What a block has."""

ARGUMENTS = {"initial_state": "p, u", "step": "p, x, u, h", "outputs": "p, x, u"}
"""What its functions take."""

SLAVES = {"Fmi2Slave": "pythonfmu", "Fmi3Slave": "pythonfmu3"}
"""What makes FMUs of the classes that have these bases, and how these are called."""

LONGEST_TRIAL = 30.0
"""s that a function of a block may take as it is tried, and its file to be imported."""


@contextmanager
def own_model(file: Path) -> Iterator[Model]:
    """The model of the block in a file, which is among the imported modules meanwhile.

    The block may import the standard library, from PACKAGES, and what it names in REQUIRES, which
    is not packed: it must be installed where the FMU runs.
    ValueError, one line, where the file is no such block.
    """
    name = fmu_name(file)
    text, tree = _parsed(file)
    _check_slaves(file, tree)
    _check_imports(file, text, tree)
    with _run(file, tree) as block:
        summary, _, details = inspect.cleandoc(block.__doc__ or "").partition("\n")
        if not summary:
            raise ValueError(f"{file}: must begin with a docstring; its first line describes it")
        yield Model(
            Description(name, summary.rstrip("."), _variables(file, block)),
            f"{details.strip()}\n\n{BEGIN}{variable_tables({name: block})}",
            {
                f"{name}.py": script(f"import {file.stem}_block_{HASH} as block"),
                f"{file.stem}_block.py": text.encode(),
            },
            block,
            file,
            requires=_required(file, tree),
        )


def fmu_name(file: Path) -> str:
    """The name of the FMU of the block in a file: MyPlant of my_plant.py; ValueError for none."""
    is_identifier = file.stem.isascii() and file.stem.isidentifier()
    if file.suffix != ".py" or not is_identifier or file.stem.startswith("_"):
        is_ours = file.name == str(file) and together(file.name) is not None
        native = f"; {file} is a built-in block: --native builds it on its own" if is_ours else ""
        must = "must be NAME.py, NAME of letters, digits and _, a letter first"
        raise ValueError(f"{file}: {must}{native}")
    name = "".join(word[:1].upper() + word[1:] for word in file.stem.split("_"))
    for shipped in (*SHIPPED, *(hand for n in range(FEWEST, MOST + 1) for hand in of_fingers(n))):
        if shipped.lower() == name.lower():  # the same file on Windows
            raise ValueError(
                f"{file}: {shipped}.fmu is one of the FMUs that come with this package"
            )
    return name


def _check_slaves(file: Path, tree: ast.Module) -> None:
    """ValueError where there is a class of which another tool makes an FMU."""
    classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
    for node in classes:
        for base in node.bases:
            if tool := SLAVES.get(ast.unparse(base).rpartition(".")[2]):
                raise ValueError(
                    f"{file}: line {node.lineno}: is a class of {tool}, and no block; "
                    f"`{tool} build -f {quote(str(file))}` makes its FMU; "
                    f"a block has {', '.join(PARTS)}"
                )


def _parsed(file: Path) -> tuple[str, ast.Module]:
    try:
        text = file.read_text("utf-8")
        return text, ast.parse(text.encode(), str(file))
    except (SyntaxError, ValueError) as error:
        number = getattr(error, "lineno", None)  # there is none for a NUL byte, or none of UTF-8
        line = f" line {number}:" if number else ""
        raise ValueError(f"{file}:{line} is not Python: {getattr(error, 'msg', error)}") from error


def _check_imports(file: Path, text: str, tree: ast.Module) -> None:
    """ValueError where a module that the block imports could not be packed."""
    renamed = {text.count("\n", 0, match.start()) + 1 for match in IMPORT.finditer(text)}
    installed = {*sys.stdlib_module_names, *_required(file, tree)}
    for node in ast.walk(tree):
        packable = False
        if isinstance(node, ast.Import):
            modules = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            modules = ["." * node.level + (node.module or "")]
            packable = node.col_offset == 0 and node.lineno in renamed
        else:
            continue
        for module in modules:
            package = module.partition(".")[0]
            if package not in installed and not (packable and package in PACKAGES):
                must = _importable(file, package)
                raise ValueError(f"{file}: line {node.lineno}: imports {module}; {must}")


def _importable(file: Path, package: str) -> str:
    """What must be done about a package that a block imports, and which could not be packed."""
    if package in PACKAGES:
        return "must be at the top level, with single spaces: from PACKAGE import ..."
    if not package or file.with_name(package).is_dir() or file.with_name(f"{package}.py").exists():
        return "must be in the file itself, as a block is one file"
    libraries = f"must be of the standard library, or of {', '.join(PACKAGES)}"
    required = f'REQUIRES = ("{package}",) names what is to be installed where the FMU runs'
    return f"{libraries}; {required}"


def _required(file: Path, tree: ast.Module) -> tuple[str, ...]:
    """The packages in REQUIRES = ("NAME", ...), as it stands in the file."""
    for node in tree.body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "REQUIRES":
            with suppress(ValueError):  # no literal
                names = ast.literal_eval(node.value)
                if isinstance(names, tuple):
                    return tuple(map(str, names))
            raise ValueError(f'{file}: line {node.lineno}: REQUIRES: must be as in ("numpy",)')
    return ()


@contextmanager
def _run(file: Path, tree: ast.Module) -> Iterator[Any]:
    """The module of a file, which is among the imported ones meanwhile: annotations need that."""
    name = f"{file.stem}_block"
    module = module_from_spec(ModuleSpec(name, SourceFileLoader(name, str(file))))
    earlier = sys.modules.get(name)
    sys.modules[name] = module
    try:
        with redirect_stdout(sys.stderr):
            with _tried(file, "import"):
                exec(compile(tree, str(file), "exec"), vars(module))  # noqa: S102 - the user's own
            missing = ", ".join(part for part in PARTS if not hasattr(module, part))
            if missing:
                raise ValueError(f"{file}: has no {missing}; a block has {', '.join(PARTS)}")
            _check_parts(file, module)
            yield module
    finally:
        del sys.modules[name]
        if earlier:
            sys.modules[name] = earlier


def _check_parts(file: Path, block: Any) -> None:
    """ValueError where a class of a block is not of its kind, or a function takes other things."""
    options = getattr(block.Params, "__dataclass_params__", None)
    if options is None or not options.frozen:
        raise ValueError(f"{file}: Params: must be a frozen dataclass: @dataclass(frozen=True)")
    for name in ("Inputs", "Outputs"):
        if not hasattr(getattr(block, name), "_fields"):
            raise ValueError(f"{file}: {name}: must be a NamedTuple: class {name}(NamedTuple)")
    for name, arguments in ARGUMENTS.items():
        signature = inspect.signature(getattr(block, name))
        try:
            signature.bind(*arguments.split())
        except TypeError as error:
            must = f"must be {name}({arguments})"
            raise ValueError(f"{file}: {name}{signature}: {must}") from error


def _variables(file: Path, block: Any) -> list[Variable]:
    """Return the variables of a block that works at its start values."""
    with _tried(file, "Params()"):
        p = block.Params()
    with _tried(file, "Inputs()"):
        u = block.Inputs()
    with _tried(file, "declaration"):
        declaration = declared(block)
        scalars = variables(declaration)
        _check_declaration(scalars)
        longest_step(block)
    with _tried(file, "initial_state()"):
        first = block.initial_state(p, u)
        kinds_at_start = _kinds(first)
    with _tried(file, "step()"):
        second = block.step(p, first, u, 1e-3)
        kinds = _kinds(second)
        for name in {
            **kinds_at_start,
            **kinds,
        }:  # or a saved state would come back as another: 0.5 as 0
            kind, like = (
                k[name].__name__ if name in k else "not there" for k in (kinds, kinds_at_start)
            )
            if kind != like:
                zero = "; write 0.0 for 0 there" if (kind, like) == ("float", "int") else ""
                must = f"must be as initial_state() makes it, {like}{zero}"
                raise ValueError(f"{name} is {kind}: {must}")
    outputs = [v for v in scalars if v.causality == "output"]
    with _tried(file, "outputs()"):
        for x in (first, second):
            y = block.outputs(p, x, u)
            if not isinstance(y, tuple) or len(y) != len(block.Outputs._fields):
                must = f"must return Outputs({', '.join(block.Outputs._fields)})"
                raise ValueError(f"returns {y!r}: {must}")
            values = unpacker(declaration)(y)
            for v, value in zip(outputs, values, strict=True):
                _check_type(v, value, *([int] if v.kind is float else []))
                if not isfinite(value):
                    raise ValueError(f"{v.name} = {value!r}{v.in_unit}: must be finite")
    return scalars


def _check_type(v: Variable, value: Any, *accepted: type[Any]) -> None:
    if type(value) not in (v.kind, *accepted):
        raise ValueError(f"{v.name} = {value!r}: must be of type {v.kind.__name__}")


def _check_declaration(scalars: list[Variable]) -> None:
    names = [v.name for v in scalars]
    for v in scalars:
        if names.count(v.name) > 1:
            share = "inputs, outputs and parameters share their names"
            raise ValueError(f"{v.name}: appears twice; {share}")
        if v.unit and (text := refusal(v.unit)):
            raise ValueError(f"{v.name}: {text}")
        if not v.name.isascii():
            raise ValueError(f"{v.name}: must be of ASCII letters, digits and _")
        if v.causality != "output":
            _check_type(v, v.start)
            low, high = v.limits or (-inf, inf)
            if low > high:
                raise ValueError(f"{v.name}: low = {low!r}: must not be above high = {high!r}")
            v.check(v.start)


def _kinds(state: Any, name: str = "State") -> dict[str, type[Any]]:
    """The types of the scalars in a state, by name; ValueError where it could not be saved."""
    if isinstance(state, tuple):
        labels = [f".{field}" for field in getattr(state, "_fields", ())]
        labels = labels or [f"[{i + 1}]" for i in range(len(state))]
        kinds: dict[str, type[Any]] = {}
        for label, item in zip(labels, state, strict=True):
            kinds |= _kinds(item, name + label)
        return kinds
    if state is None and name == "State":
        raise ValueError("returns None: must return State(...)")
    if not isinstance(state, (float, int)):
        raise ValueError(f"{name} = {state!r}: must be float, bool, int, or a tuple of those")
    return {name: type(state)}


@contextmanager
def _tried(file: Path, activity: str) -> Iterator[None]:
    """Raise what goes wrong in the user's code as a ValueError that says what and where.

    So it is if that takes longer than LONGEST_TRIAL.
    """
    try:
        with _ended_after(LONGEST_TRIAL):
            yield
    except (Exception, SystemExit, _EndlessError) as error:
        frames = traceback.extract_tb(error.__traceback__)
        lines = [frame.lineno for frame in frames if frame.filename == str(file)]
        place = f" line {lines[-1]}:" if lines else ""
        raise ValueError(f"{file}:{place} {activity}: {_reason(error)}") from error


def _reason(error: BaseException) -> str:
    """What a user's code raised, and what helps, in one line."""
    if isinstance(error, _EndlessError):
        remedy = "must end; for a loop with a bound write for ... in range(n), with break"
        return f"was not done after {LONGEST_TRIAL:g} s; {remedy}"
    message = f"{type(error).__name__}: {' '.join(str(error).splitlines())}"
    if isinstance(error, ModuleNotFoundError) and error.name:
        return f"{message}; it may be had by: python -m pip install {error.name.partition('.')[0]}"
    constructor = re.match(r"(Input|Output|Parameter)\.__init__\(\)", str(error))
    if constructor and isinstance(error, TypeError):
        valid = [
            f"{f.name}=..." for f in fields(getattr(block_variables, constructor[1])) if f.kw_only
        ]
        return f"{message}; valid: {constructor[1]}(meaning, {', '.join(valid)})"
    return message


class _EndlessError(BaseException):
    """Raised in a user's code that takes too long, which may catch an Exception in its loop."""


@contextmanager
def _ended_after(seconds: float) -> Iterator[None]:
    """Raise _EndlessError in the Python code that runs here for longer than that."""
    thread = ctypes.c_ulong(threading.get_ident())
    raise_there = partial(
        ctypes.pythonapi.PyThreadState_SetAsyncExc, thread, ctypes.py_object(_EndlessError)
    )
    timer = threading.Timer(seconds, raise_there)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()  # so that nothing is raised once this is over
