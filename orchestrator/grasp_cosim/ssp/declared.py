"""What SSP needs of an FMU beyond its interface: names of enumeration items, and a step size."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from ..system.model_description import read_description


@dataclass(frozen=True, slots=True)
class Declared:
    """The items of each enumeration variable with their numbers; step in s, None without one."""

    items: Mapping[str, Mapping[str, int]]
    step: float | None


def declared(path: Path) -> Declared:
    """What the FMU at path declares."""
    return _declared(path.resolve(), path.stat().st_mtime_ns)


@lru_cache(maxsize=64)
def _declared(path: Path, modified: int) -> Declared:
    description, _, _ = read_description(path)
    items = {
        v.name: {item.name: int(item.value) for item in v.declaredType.items}
        for v in description.modelVariables
        if v.type == "Enumeration" and v.declaredType
    }
    experiment = description.defaultExperiment
    step = experiment.stepSize if experiment else None
    return Declared(items, None if step is None else float(step))
