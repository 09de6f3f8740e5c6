"""Checks of arguments and of entries of files, each with its one-line error.

Every message is `PLACE = VALUE: must be ...`: where the value comes from, the value, what is valid.
"""

import math
import re
import shlex
import sys
import tomllib
from collections.abc import Collection, Iterable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from .errors import InputError, choices, nearest, reason

_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+([eE][-+]?\d+)?")

EXACT = 2**53
"""Whole numbers of a smaller magnitude are exact as a float64."""


def is_number(value: Any) -> bool:
    """Return True if `value` is an int or a float; a bool is no number."""
    return isinstance(value, float | int) and not isinstance(value, bool)


def number(
    place: str,
    value: Any,
    low: float = -math.inf,
    high: float = math.inf,
    *,
    above: bool = False,
    must: str = "a finite number",
    unit: str = "",
) -> float:
    """Return `value`, a finite number from `low` to `high`, as a float.

    With `above`, `low` itself is too low. `must` says what is valid, `unit` follows the value in
    the message. InputError otherwise.
    """
    holds = is_number(value) and abs(value) <= sys.float_info.max and low <= value <= high
    if not holds or (above and value == low):
        raise InputError(f"{place} = {value!r}{unit and f' {unit}'}: must be {must}")
    return float(value)


def whole(
    place: str,
    value: Any,
    low: float = -math.inf,
    high: float = math.inf,
    *,
    must: str = "a whole number",
) -> int:
    """Return `value`, a whole number from `low` to `high`; `must` says what is valid.

    InputError otherwise.
    """
    if not is_number(value) or not isinstance(value, int) or not low <= value <= high:
        raise InputError(f"{place} = {value!r}: must be {must}")
    return int(value)


def exact(place: str, value: Any, text: str = "", failure: type[Exception] = InputError) -> None:
    """Refuse a whole number that a float64, in which values travel, may not tell from the next.

    All other values are fine. `text` is how the message quotes it, by default as Python does;
    `failure` is what is raised, with the line.
    """
    if isinstance(value, int) and abs(value) >= EXACT:
        raise failure(
            f"{place} = {text or value}: must be smaller than 2**53 in magnitude, to be exact as a "
            "float64"
        )


def real(text: str) -> float:
    """Return the number that a text of a file stands for, as all tools write it.

    ValueError where it is none; Python itself takes 1_0 for 10, and the digits of any script.
    """
    if "_" in text or not text.isascii():
        raise ValueError(f"{text!r}: must be a number")
    return float(text)


def point_advice(value: object) -> str:
    """What a message adds for a number that is written with a decimal comma; else nothing."""
    if isinstance(value, str) and _DECIMAL_COMMA.fullmatch(value.strip()):
        return ", with a point before its decimals"
    return ""


def integer(text: str) -> int:
    """Return the whole number that a text of a file stands for; ValueError as of real()."""
    if "_" in text or not text.isascii():
        raise ValueError(f"{text!r}: must be a whole number")
    return int(text)


def choice(place: str, value: Any, valid: Iterable[Any]) -> Any:
    """Return `value`, one of `valid`; InputError otherwise."""
    choices_list = list(valid)
    if isinstance(value, bool) or value not in choices_list:
        raise InputError(f"{place} = {value!r}: must be one of {choices(choices_list)}")
    return value


def text(place: str, value: Any, must: str) -> str:
    """Return `value`, a string; `must` says what is valid. InputError otherwise."""
    if not isinstance(value, str):
        raise InputError(f"{place} = {value!r}: must be {must}")
    return value


def known(place: str, name: Any, valid: Collection[Any], suffix: str = "", see: str = "") -> None:
    """InputError "PLACE 'name'SUFFIX; did you mean ...?" where `name` is not one of `valid`.

    `place` begins the message, `suffix` follows the name; `see` is as of errors.nearest.
    """
    if name not in valid:
        raise InputError(f"{place} {name!r}{suffix}; {nearest(name, valid, see)}")


def as_table(place: str, value: Any) -> dict[str, Any]:
    """Return `value`, a table of a TOML or JSON file; InputError where it is none."""
    if not isinstance(value, dict):
        actual = "missing" if value is None else repr(value)
        raise InputError(f"{place}: {actual}; must be a table")
    return value


def check_keys(place: str, table: Mapping[str, Any], valid: Iterable[str]) -> None:
    """InputError at the first key of `table` that is not one of `valid`."""
    for key in table:
        if key not in valid:
            raise InputError(f"{place}: unknown entry {key!r}; {nearest(key, sorted(valid))}")


def check_values(place: str, values: Mapping[str, Any]) -> None:
    """InputError at the first value that is no number, boolean or string, or list of such."""
    for name, value in values.items():
        if not is_value(value):
            raise InputError(
                f"{place}: {name} = {value!r}: must be a number, boolean or string; a name with a "
                'dot stands in quotes, like "sensor_1.reflectance" = 0.6'
            )


def is_value(value: Any) -> bool:
    """Return True for a number, a boolean, a string, or a list of such or of lists."""
    if isinstance(value, list):
        return all(map(is_value, value))
    return isinstance(value, float | int | bool | str)


def extra_module(name: str, purpose: str, extra: str) -> Any:
    """Return the module `name`, which is optional; `purpose` says what it is for.

    It belongs to one of our extras, or else to the package of its name. InputError with
    the command that installs it here where it is missing.
    """
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        raise InputError(
            f"{name.partition('.')[0]} is not installed, {purpose}; "
            f"install it with: {install_command(*(packages(extra) or [name]))}"
        ) from error


def packages(extra: str) -> list[str]:
    """Return the requirement of one of our extras, like "matplotlib>=3.9".

    A package index may not have us, nor a folder that a command is given in: these are named.
    """
    from importlib.metadata import requires

    of_the_extra = re.compile(rf"([^;]*[^; ]) *; extra == .{extra}.")
    declared = requires("grasp-cosim") or []
    return [requirement[1] for line in declared if (requirement := of_the_extra.fullmatch(line))]


def install_command(*requirements: str) -> str:
    """Return the command that installs packages for the Python that runs."""
    return shlex.join([sys.executable, "-m", "pip", "install", *requirements])


def toml_table(path: Path, kind: str) -> dict[str, Any]:
    """Return the content of a TOML file; `kind` names it where there is none, "system file".

    InputError where it is missing or not readable as TOML.
    """
    text = ""
    try:
        text = path.read_text("utf-8-sig")
        table = tomllib.loads(text)
        repr(table)  # a hexadecimal number longer than Python writes is refused here
    except FileNotFoundError:
        raise InputError(f"{path}: no such {kind}") from None
    except (OSError, ValueError, RecursionError) as error:
        position = re.search(r"at line (\d+)", str(error))
        line = text.splitlines()[int(position[1]) - 1].strip() if position else ""
        why = reason(error).replace("Cannot overwrite a value", "a key is given a second time")
        if line:
            why += f": {line}"
        if _BARE_FRACTION.search(line):
            why += '; a fraction must be in quotes, like "1/30"'
        raise InputError(f"{path}: not readable as TOML: {why}") from error
    return table


_BARE_FRACTION = re.compile(r"=\s*\d+\s*/\s*\d+\s*(#.*)?$")
"""A line of TOML with a fraction that is no text."""
