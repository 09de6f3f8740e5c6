"""A seed for everything random in each run of a sweep.

The seed of run i at the k-th place, both counted from 0, is the first word of NumPy's
SeedSequence((s, i, k)) modulo a milliard. s is the seed of the system there. So it is the same on
any machine, in any order of the runs, and no two places share their noise.
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
"""What is asked for where each run has its own seeds."""

SEED_LIMIT = 10**9
"""Seeds are smaller than this."""

_FAULT_SEED = re.compile(r"faults\[(\d+)\]\.seed")


def seeds_of_runs(system: System, rows: Sequence[Row], seed: str | None) -> list[dict[str, int]]:
    """The seeds of each run by place, of places that its row leaves; none without a `seed`.

    InputError where that is not OF_A_RUN, or where nothing in the system is random.
    """
    if seed is None:
        return [{} for _ in rows]
    if seed != OF_A_RUN:
        raise InputError(f"seed = {seed!r}: must be {OF_A_RUN!r}, or None")
    system_seeds = _system_seeds(system)
    if not system_seeds:
        raise InputError(
            f"seed = {seed!r}: nothing in {system.name} is random; must have a fault that is, or "
            "an FMU with a parameter seed"
        )
    seeds_by_run = []
    for run, row in enumerate(rows):
        seeds = {
            place: _run_seed(system_seed, run, number)
            for number, (place, system_seed) in enumerate(system_seeds.items())
        }
        seeds_by_run.append({place: seeds[place] for place in seeds if place not in row})
    return seeds_by_run


def with_row(system: System, row: Row) -> System:
    """The system with the overrides of a row, in the units of its FMUs, seeds of faults among them.

    InputError as of with_settings().
    """
    fault_seeds: dict[int, int] = {}
    overrides = {}
    for place, value in row.items():
        if match := _FAULT_SEED.fullmatch(place):
            fault_seeds[int(match[1])] = int(value)
        else:
            overrides[place] = value
    changed = system.with_overrides(as_overrides(overrides, "sweep: {place}"))
    if not fault_seeds:
        return changed
    faults = [
        replace(fault, seed=fault_seeds.get(number, fault.seed))
        for number, fault in enumerate(changed.faults, 1)
    ]
    return replace(changed, faults=tuple(faults))


def _system_seeds(system: System) -> Mapping[str, int]:
    """The seeds that a system has, by place: of parameters called seed, and of random faults."""
    seeds: dict[str, Any] = {}
    for component in system.components:
        for variable in component.interface.variables:
            is_parameter = variable.kind == "Integer" and variable.causality == "parameter"
            if is_parameter and variable.name.rpartition(".")[2] == "seed":
                seed = component.values.get(variable.name, variable.start_value)
                seeds[f"{component.name}.{variable.name}"] = seed
    for number, fault in enumerate(system.faults, 1):
        if fault.kind in RANDOM:
            seeds[f"faults[{number}].seed"] = fault.seed
    return {place: int(seed or 0) for place, seed in seeds.items()}


def _run_seed(system_seed: int, run: int, number: int) -> int:
    """The seed of a run at the place of that number."""
    return int(np.random.SeedSequence((system_seed, run, number)).generate_state(1)[0]) % SEED_LIMIT
