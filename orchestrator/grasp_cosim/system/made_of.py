"""What a system is made of, and what of it was changed since it was read."""

from typing import Any

from .parts import NANOSECONDS
from .structure import Structure


def made_of(system: Structure) -> dict[str, Any]:
    """Its FMUs by component, the values given by variable, and the experiment; times in s."""
    return {
        **{c.name: c.fmu.name for c in system.components},
        **{f"{c.name}.{name}": v for c in system.components for name, v in c.values.items()},
        "step": system.step_ns / NANOSECONDS,
        "stop": system.stop_ns / NANOSECONDS,
        "start": system.start_ns / NANOSECONDS,
        "scheme": system.scheme,
        "diverging": system.diverging,
        **({"input": system.input.file} if system.input else {}),
    }


def changed(system: Structure) -> dict[str, Any]:
    """Of made_of() what is not as it was read, as types that JSON has.

    A value that was not given there is compared with the one that the FMU starts with.
    """
    starts = {
        f"{c.name}.{name}": c.interface.by_name[name].start_value
        for c in system.components
        for name in c.values
    }
    return {
        key: value
        for key, value in made_of(system).items()
        if value != system.as_read.get(key, starts.get(key))
    }
