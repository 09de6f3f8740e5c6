"""From an FMU's interface to what a proxy of it and its peer exchange."""

from collections.abc import Callable
from math import isfinite
from pathlib import Path

from grasp_fmus.link.message import check_size, exposed, read_key
from grasp_fmus.link.peer import ALIVE
from grasp_fmus.link.signature import ORDER, LinkVariable, Signature

from ..base.errors import InputError
from ..interface.expansion import expanded
from ..interface.interface import Interface, Variable
from ..interface.read import read_interface
from ..system.parts import NANOSECONDS

LONGEST_SILENCE = ALIVE / NANOSECONDS
"""s after which another proxy may take over a session."""

WIDE = ("UInt32", "Int64", "UInt64")
"""Integer types that an Integer of FMI 2.0 does not hold."""

TEXT = "a text, as the link has none"


def exchanged(fmu: Path) -> Interface:
    """Return the interface of an FMU, with elements in the place of arrays of numbers."""
    interface = read_interface(fmu)
    return interface if interface.sized_by is None else expanded(interface, {})


def link_signature(interface: Interface) -> tuple[Signature, list[str]]:
    """Return the signature of an FMU, and notes on what is left out.

    InputError where an input or output cannot be exchanged.
    """
    taken: list[LinkVariable] = []
    left_out: dict[str, list[str]] = {}
    for v in interface.of(*ORDER, "structuralParameter"):
        reason = _obstacle(v)
        if reason is None:
            # no other kind and causality is left
            taken.append(LinkVariable(v.name, v.kind, v.causality, v.unit))  # type: ignore[arg-type]
        elif v.causality in ("input", "output") and reason != TEXT:
            raise InputError(
                f"{interface.path}: {v.causality} {v.name} is {reason}, which a proxy cannot "
                "exchange; must be of 64 bit floating point, 32 bit, Boolean or an array of these"
            )
        else:
            left_out.setdefault(reason, []).append(v.name)
    file = interface.path.name
    notes = [f"{file}: {', '.join(v)}: {reason}: left out" for reason, v in left_out.items()]
    try:
        signature = Signature(tuple(taken))
        check_size(signature)
    except ValueError as error:
        raise InputError(f"{interface.path}: {error}") from error
    return signature, notes


def shared_key(path: Path, say: Callable[[str], None]) -> bytes:
    """Return the key in a file, and say where others can read it.

    InputError where it is too short to be one.
    """
    try:
        key = read_key(path)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error
    if said := exposed(path):
        say(said)
    return key


def _obstacle(v: Variable) -> str | None:
    if v.causality == "structuralParameter":
        return "structural"
    if not v.supported:
        return f"of type {v.nature}"
    if v.kind == "String":
        return TEXT
    if v.type in WIDE:
        return f"of type {v.type}"
    if v.kind == "Real" and v.start is not None and not isfinite(float(v.start)):
        return f"{v.start} at the start"
    return None
