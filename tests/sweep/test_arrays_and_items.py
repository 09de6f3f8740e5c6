"""Studies of elements of arrays and of items of enumerations by name."""

from pathlib import Path

import pytest
from grasp_cosim import InputError, System
from grasp_cosim.sweep.read import Made, read_studies
from grasp_cosim.sweep.study import Study
from support.state_space import state_space

STUDY = """
system = "system.toml"
outputs = ["ss.y[1]"]
[values]
"ss.A" = [[0, 1], [-1, 0]]
"ss.n" = 2
[design]
kind = "grid"
[[parameters]]
variables = ["ss.u_Enumeration[1,2]"]
values = ["slow", "fast"]
[[parameters]]
variables = ["ss.u[2]"]
values = [1.0, 2.0]
"""


def study(folder: Path, text: str = STUDY) -> Study:
    state_space(folder, types=True, binary=False)
    table = '[experiment]\nstep = 0.1\nstop = 1.0\n[components.ss]\nfmu = "ss.fmu"\n'
    (folder / "system.toml").write_text(table, "utf-8")
    (folder / "study.toml").write_text(text, "utf-8")

    def load(path: Path | None) -> System:
        assert path is not None
        return System.load(path)

    return read_studies(folder / "study.toml", Made(load))[0]


def test_each_run_sets_elements_and_items(tmp_path: Path) -> None:
    found = study(tmp_path)
    assert found.system.component("ss", "").values["A[2,1]"] == -1.0
    runs = [found.system.with_values(found.values(k)) for k in range(found.runs)]
    values = [run.component("ss", "").values for run in runs]
    assert [(v["u_Enumeration[1,2]"], v["u[2]"]) for v in values] == [
        (1, 1.0), (1, 2.0), (2, 1.0), (2, 2.0),
    ]  # fmt: skip
    assert found.point(3)["ss.u_Enumeration[1,2]"] == "fast"


@pytest.mark.parametrize(
    ("was", "now", "message"),
    [
        ('"slow", "fast"', '"slow", "quick"', "must be one of slow, fast"),
        ("ss.u[2]", "ss.u", "ss.u: ss.fmu has no variable 'u'"),
        ("[[0, 1], [-1, 0]]", "[[0, 1]]", r"ss.A: A = [[0, 1]]: is [1, 2]; must be [2, 2], or"),
        ("ss.y[1]", "ss.y[4]", "outputs: no output 'ss.y[4]'; did you mean ss.y[1], ss.y[2]"),
    ],
)
def test_a_mistake_is_one_line(tmp_path: Path, was: str, now: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        study(tmp_path, STUDY.replace(was, now))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
