"""What SSP needs of an FMU beyond its interface: units, names of enumeration items, step size."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import fmpy

from ..system.units import BASE, Unit


@dataclass(frozen=True, slots=True)
class Declared:
    """units by name, without those that no base unit defines; items by variable; step in s."""

    units: Mapping[str, Unit]
    items: Mapping[str, Mapping[str, int]]
    step: float | None


def declared(path: Path) -> Declared:
    """What the FMU at path declares; its interface has been read before, so that it is readable."""
    return _declared(path.resolve(), path.stat().st_mtime_ns)


@lru_cache(maxsize=64)
def _declared(path: Path, modified: int) -> Declared:
    description = fmpy.read_model_description(path, validate=False)
    units = {
        unit.name: Unit(
            unit.name,
            tuple(getattr(unit.baseUnit, base) for base in BASE),
            unit.baseUnit.factor,
            unit.baseUnit.offset,
        )
        for unit in description.unitDefinitions
        if unit.baseUnit
    }
    items = {
        v.name: {item.name: int(item.value) for item in v.declaredType.items}
        for v in description.modelVariables
        if v.type == "Enumeration" and v.declaredType
    }
    experiment = description.defaultExperiment
    step = experiment.stepSize if experiment else None
    return Declared(units, items, None if step is None else float(step))
