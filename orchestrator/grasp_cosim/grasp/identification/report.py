"""An identification for a terminal, as JSON, as values for a system, as a table of residuals."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ...numerals import fixed
from ..published.report import table_csv
from .fit import Estimate, Fit

ASSUMPTIONS = (
    "95 % confidence intervals of the linearised model, for residuals that are independent, of one "
    "variance and without a bias"
)

SHOWN = 60
"""So many residuals at most are printed; --json and --out have all."""


@dataclass(frozen=True, slots=True)
class Identification:
    """A fit, what it was made from, and what its residuals belong to, in their unit."""

    data: str
    unit: str
    fit: Fit
    rows: Sequence[dict[str, Any]]
    scatter: float | None = None
    """Standard deviation of data that were measured under equal conditions, if any were."""


def as_json(found: Identification) -> dict[str, Any]:
    """The object of `identify --json`."""
    return {
        "data": found.data,
        "parameters": [e._asdict() for e in found.fit.estimates],
        "assumptions": ASSUMPTIONS,
        "rms": found.fit.rms,
        "scatter": found.scatter,
        "unit": found.unit,
        "points": found.fit.points,
        "rows": _rows(found),
    }


def text(found: Identification) -> str:
    """The parameters, the root mean square, and the residuals unless they are many."""
    lines = [
        f"{found.data}; {ASSUMPTIONS}",
        *(f"  {e.name:32s}{e.value:10.4g} {_about(e)}" for e in found.fit.estimates),
        f"residuals: root mean square {found.fit.rms:.4g} {found.unit} over {len(found.rows)}",
    ]
    if found.scatter is not None:
        lines.append(
            f"equal conditions scatter by {found.scatter:.3g} {found.unit}, which no fit explains"
        )
    if len(found.rows) <= SHOWN:
        lines += [
            "  " + "  ".join(f"{key} {_short(value)}" for key, value in row.items())
            for row in _rows(found)
        ]
    return "\n".join(lines)


def values_toml(found: Identification) -> str:
    """The estimates as a table [values], with where they are from as comments."""
    lines = [
        f"# {found.data}: root mean square of the residuals {found.fit.rms:.4g} {found.unit}",
        "[values]",
        *(f'"{e.name}" = {float(f"{e.value:.6g}")!r}  # {_about(e)}' for e in found.fit.estimates),
    ]
    return "\n".join(lines) + "\n"


def residuals_csv(found: Identification) -> str:
    """A line per residual."""
    return table_csv(_rows(found))


def _rows(found: Identification) -> list[dict[str, Any]]:
    return [
        {**row, "residual": float(r)}
        for row, r in zip(found.rows, found.fit.residuals, strict=True)
    ]


def _about(e: Estimate) -> str:
    interval = f"[{e.interval[0]:.4g}, {e.interval[1]:.4g}]" if e.interval else ""
    told = ": ".join(t for t in (interval, e.remark) if t)
    return f"{e.unit}, {told}"


def _short(value: object) -> str:
    return fixed(value, 3, rounded=True) if isinstance(value, float) else str(value)
