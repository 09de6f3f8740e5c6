"""The table of a study's runs: types of its columns, and what is said of them."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq  # type: ignore[import-untyped]
import pytest
from grasp_cosim import System
from grasp_cosim.sweep.design import Design
from grasp_cosim.sweep.distributions import Listed
from grasp_cosim.sweep.study import Parameter, Study
from grasp_cosim.sweep.table import Table, write_parquet

COLUMNS: dict[str, list[object]] = {
    "whole and not": [2**60, 0.5, None],
    "whole": [2**63 - 1, -(2**63), None],
    "unsigned": [2**64 - 1, 0, None],
    "too big": [2**70, -1, 0],
    "true": [True, None, False],
    "text": ["a", None, "b"],
    "none": [None, None, None],
    "infinite": [float("inf"), float("-inf"), float("nan")],
    "error": [None, None, None],
}


@pytest.fixture
def study(grasp: System) -> Study:
    return Study(
        "m", grasp, (Parameter("p", ("plant.object_width",), Listed((0.07,))),), Design("grid")
    )


def test_every_column_has_a_type_that_holds_it(study: Study, tmp_path: Path) -> None:
    path = tmp_path / "runs.parquet"
    write_parquet(Table(COLUMNS, (), tuple(COLUMNS)), study, path)
    found = pq.read_table(path)
    types = [str(field.type) for field in found.schema]
    assert types == [
        "double", "int64", "uint64", "double", "bool", "string", "double", "double", "string",
    ]  # fmt: skip
    for name, column in COLUMNS.items():
        if name != "infinite":
            assert found.column(name).to_pylist() == column, name
    np.testing.assert_array_equal(found.column("infinite").to_pylist(), [np.inf, -np.inf, np.nan])


def test_a_summary_is_of_what_is_finite() -> None:
    values = [*range(101), None, float("nan"), float("inf")]
    found = Table({"a": values, "b": [None]}, (), ("a", "b")).summary()
    assert found["a"] == pytest.approx(
        {"runs": 101, "least": 0, "p5": 5, "median": 50, "p95": 95, "greatest": 100, "mean": 50}
    )
    assert found["b"] == {"runs": 0, **dict.fromkeys(list(found["a"])[1:])}
