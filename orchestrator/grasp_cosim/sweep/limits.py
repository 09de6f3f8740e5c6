"""The limits that a study sets: what its runs reach, and if they keep them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from .study import Limit
from .sweep import Sweep
from .table import summarized


@dataclass(frozen=True, slots=True)
class Reached:
    """What the runs of a study reach of a limit, in a column of the results.

    value is None where no run has one; missing is how many have none, of which none may be.
    """

    variant: str
    column: str
    limit: Limit
    value: float | None
    missing: int

    @property
    def kept(self) -> bool:
        """True if every run has a value, and their statistic is at most the limit."""
        return not self.missing and self.value is not None and self.value <= self.limit.most

    def as_json(self) -> dict[str, Any]:
        """As plain values for JSON."""
        return {**asdict(self), "kept": self.kept}


def reached(sweeps: Sequence[Sweep]) -> list[Reached]:
    """What the variants of a study reach, a line per limit and column."""
    by_variant = {sweep.study.variant: sweep for sweep in sweeps}
    return [
        _reached(sweep, by_variant[limit.reference] if limit.reference else None, limit, column)
        for sweep in sweeps
        for limit in sweep.study.limits
        for column in sweep.study.columns_of(limit.metric, "limits")
    ]


def _reached(sweep: Sweep, other: Sweep | None, limit: Limit, column: str) -> Reached:
    values = sweep.numbers(column)
    if other:
        values = np.abs(values - other.numbers(column))
    missing = len(values) - int(np.isfinite(values).sum())
    value = summarized(values)[limit.statistic]
    return Reached(sweep.study.variant, column, limit, value, missing)
