"""A seed of its own for all that is random in each run of a sweep.

The seed of run i at the k-th place, both counted from 0, is the first word of NumPy's
SeedSequence((own, i, k)) modulo a milliard, where own is the seed that the system has there. So it
is the same on any machine, in any order of the runs, and no two places share their noise.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..system.description import System
from ..system.faults import RANDOM
from ..system.overrides import as_overrides
from .rows import Row

OF_A_RUN = "run"
"""What is asked for where each run has seeds of its own."""

BELOW = 10**9
"""Seeds are smaller than this."""

_FAULT = re.compile(r"faults\[(\d+)\]\.seed")


def seeds_of_runs(system: System, rows: Sequence[Row], seed: str | None) -> list[dict[str, int]]:
    """The seeds of each run by place, of places that its row leaves; none without a `seed`.

    InputError where that is not OF_A_RUN, or where nothing in the system is random.
    """
    if seed is None:
        return [{} for _ in rows]
    if seed != OF_A_RUN:
        raise InputError(f"seed = {seed!r}: must be {OF_A_RUN!r}, or None")
    if not (own := _places(system)):
        raise InputError(
            f"seed = {seed!r}: nothing in {system.name} is random; must have a fault that is, or "
            "an FMU with a parameter seed"
        )
    return [
        {
            place: _drawn(own[place], run, number)
            for number, place in enumerate(own)
            if place not in row
        }
        for run, row in enumerate(rows)
    ]


def with_row(system: System, row: Row) -> System:
    """The system with the overrides of a row, in the units of its FMUs, seeds of faults among them.

    InputError as of with_settings().
    """
    seeds = {int(found[1]): int(row[p]) for p in row if (found := _FAULT.fullmatch(p))}
    overrides = {place: value for place, value in row.items() if not _FAULT.fullmatch(place)}
    changed = system.with_overrides(as_overrides(overrides, "sweep: {place}"))
    if not seeds:
        return changed
    faults = enumerate(changed.faults, 1)
    return replace(changed, faults=tuple(replace(f, seed=seeds.get(i, f.seed)) for i, f in faults))


def _places(system: System) -> Mapping[str, int]:
    """The seeds that a system has, by place: of parameters called seed, and of random faults."""
    found: dict[str, Any] = {}
    for c in system.components:
        for v in c.interface.variables:
            whole = v.kind == "Integer" and v.causality == "parameter"
            if whole and v.name.rpartition(".")[2] == "seed":
                found[f"{c.name}.{v.name}"] = c.values.get(v.name, v.start_value)
    random = ((i, f) for i, f in enumerate(system.faults, 1) if f.kind in RANDOM)
    found |= {f"faults[{i}].seed": f.seed for i, f in random}
    return {place: int(seed or 0) for place, seed in found.items()}


def _drawn(own: int, run: int, number: int) -> int:
    return int(np.random.SeedSequence((own, run, number)).generate_state(1)[0]) % BELOW
