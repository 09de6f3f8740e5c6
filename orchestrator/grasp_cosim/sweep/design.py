"""Designs: which points of the unit cube the runs of a study take, a row per run.

The kinds are in docs/studies.md. Every point is a pure function of kind, runs, seed, the
levels of the parameters, and its index.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from ..checks import choice, extra_module, whole
from ..errors import InputError

Kind = Literal["grid", "random", "latin-hypercube", "sobol", "saltelli"]
KINDS: tuple[str, ...] = get_args(Kind)
EVEN = ("sobol", "saltelli")
"""Kinds whose points are spread evenly only where they are a power of two."""

MOST = 100_000
"""Runs of a study at most."""

Points = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Design:
    """The kind, its runs (None: a grid, which follows from the levels) and the seed."""

    kind: Kind
    runs: int | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        choice("design: kind", self.kind, KINDS)
        whole("design: seed", self.seed, 0, must="a whole number from 0")
        if self.kind == "grid":
            if self.runs is not None:
                raise InputError(
                    f"design: runs = {self.runs!r}: must be left out, a grid has a run for each "
                    "combination of the values"
                )
            return
        runs = whole("design: runs", self.runs, 1, MOST, must=f"a whole number 1 to {MOST}")
        if self.kind in EVEN and runs & (runs - 1):
            raise InputError(
                f"design: runs = {self.runs}: must be a power of two where kind = {self.kind!r}"
            )

    def total(self, levels: Sequence[int | None]) -> int:
        """The number of runs; levels are those of the parameters, None where continuous.

        InputError where there are too many, or a grid has a parameter without levels.
        """
        if self.runs is None:
            if None in levels:
                raise InputError(
                    f"design: parameter {levels.index(None) + 1} has no list of values; must have "
                    "values, linspace or geomspace in a grid"
                )
            count = math.prod(n or 0 for n in levels)
        else:
            count = self.runs * (len(levels) + 2 if self.kind == "saltelli" else 1)
        if count > MOST:
            raise InputError(f"design: {count} runs: must be at most {MOST}")
        return count

    def points(self, levels: Sequence[int | None]) -> Points:
        """All points, shape (runs, parameters); errors as of total()."""
        total, width = self.total(levels), len(levels)
        if self.kind == "grid":
            return _grid([n or 0 for n in levels])
        if self.kind == "random":
            return np.random.default_rng(self.seed).random((total, width))
        stats = extra_module("scipy.stats", "it makes the designs of studies", "sweep")
        qmc, count = stats.qmc, self.runs or 0
        generator = np.random.default_rng(self.seed)
        if self.kind == "latin-hypercube":
            return np.asarray(qmc.LatinHypercube(width, rng=generator).random(count))
        columns = 2 * width if self.kind == "saltelli" else width
        even = qmc.Sobol(columns, rng=generator).random_base2(count.bit_length() - 1)
        return _saltelli(even) if self.kind == "saltelli" else np.asarray(even)


def _grid(levels: Sequence[int]) -> Points:
    """The middles of the shares that the levels have of [0, 1], in every combination."""
    middles = [(np.arange(n) + 0.5) / n for n in levels]
    return np.stack(np.meshgrid(*middles, indexing="ij"), axis=-1).reshape(-1, len(levels))


def _saltelli(even: Points) -> Points:
    """Per row of even, which is A beside B: A, B, then A with each one column of B."""
    count, width = even.shape[0], even.shape[1] // 2
    a, b = even[:, :width], even[:, width:]
    block = np.repeat(a[:, None, :], width + 2, axis=1)
    block[:, 1] = b
    for i in range(width):
        block[:, 2 + i, i] = b[:, i]
    return block.reshape(count * (width + 2), width)
