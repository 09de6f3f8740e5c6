"""Variants of a study: the same runs of systems that differ; and the limits that it sets."""

from collections.abc import Callable
from pathlib import Path

import pytest
from grasp_cosim import InputError, System
from grasp_cosim.grasp.controllers import with_controller
from grasp_cosim.grasp.presets import with_preset
from grasp_cosim.sweep.limits import reached
from grasp_cosim.sweep.read import Made, read_studies
from grasp_cosim.sweep.run import Outcome
from grasp_cosim.sweep.study import Limit, Study
from grasp_cosim.sweep.sweep import Sweep

BODY = """
[values]
"plant.object_width" = 0.06
"plant.finger_mass[1]" = 0.4
[design]
kind = "random"
runs = 3
seed = 1
[[parameters]]
variables = ["sensor_1.reflectance"]
uniform = { low = 0.3, high = 1.2 }
"""
LIMITS = "[limits]\ntime_to_contact = { greatest = 2.0, p95 = 1.5 }\n"
TWO = """
[[variants]]
name = "as-it-is"
[[variants]]
name = "learning"
controller = "adaptive"
step = 1e-3
values = { "plant.finger_mass[1]" = 0.7 }
limits = { time_difference = { median = 0.1, from = "as-it-is" } }
"""


Read = Callable[..., tuple[Study, ...]]


@pytest.fixture
def read(grasp: System, tmp_path: Path) -> Read:
    made = Made(lambda _: grasp, with_preset, with_controller)

    def studies(text: str, seed: int | None = None) -> tuple[Study, ...]:
        (tmp_path / "study.toml").write_text(text)
        return read_studies(tmp_path / "study.toml", made, seed=seed)

    return studies


def test_a_variant_goes_before_what_the_study_says(read: Read, grasp: System) -> None:
    plain, learning = read(BODY + LIMITS + TWO)
    assert [s.variant for s in (plain, learning)] == ["as-it-is", "learning"]
    assert [s.name for s in (plain, learning)] == ["study.toml, as-it-is", "study.toml, learning"]
    masses = [s.system.start("plant.finger_mass[1]") for s in (plain, learning)]
    widths = [s.system.start("plant.object_width") for s in (plain, learning)]
    assert (masses, widths) == ([0.4, 0.7], [0.06, 0.06])
    assert [s.system.step_ns for s in (plain, learning)] == [grasp.step_ns, 1_000_000]
    both = (Limit("time_to_contact", "p95", 1.5), Limit("time_to_contact", "greatest", 2.0))
    assert plain.limits == both
    assert learning.limits == (*both, Limit("time_difference", "median", 0.1, "as-it-is"))
    assert [plain.values(k) for k in range(3)] == [learning.values(k) for k in range(3)]
    (alone,) = read(BODY)
    assert (alone.variant, alone.identity) == ("", plain.identity)  # a name or limit is no result
    assert alone.identity != learning.identity


def test_a_seed_goes_before_that_of_the_study(read: Read) -> None:
    (own,), (same,), (other,) = read(BODY), read(BODY, seed=1), read(BODY, seed=2)
    assert own.identity == same.identity
    assert own.values(0) != other.values(0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("variants = []\n" + BODY, r"study.toml: variants = \[\]: must be \[\[variants\]\] tab"),
        (BODY + "[[variants]]\n", r"variants\[0\]: name = None: must be letters, digits"),
        (BODY + "[[variants]]\nname = '../x'\n", "name = '../x': must be letters"),
        (BODY + "[[variants]]\nname = 'a'\nseeds = []\n", "unknown entry 'seeds'; valid: bench"),
        (BODY + TWO + "[[variants]]\nname = 'learning'\n", "variant 'learning' twice"),
        (BODY + TWO.replace('"adaptive"', '"blind"'), "study.toml, learning: controller = 'blind'"),
        (BODY + TWO.replace('= "as-it-is" }', '= "x" }'), "no variant 'x'; valid: as-it-is, lea"),
        (
            BODY + LIMITS.replace("p95 = 1.5", "from = 'x'"),
            "limits: from: no variant 'x'; valid: n",
        ),
        (
            BODY + TWO.replace("step = 1e-3", "swap = { controller = 'other.fmu' }"),
            "learning: controller adaptive: cannot be used with another FMU for controller",
        ),
        (BODY + "[limits]\nspeed = { greatest = 1 }\n", "limits: no result 'speed'; valid: time_"),
        (BODY + "[limits]\ntime_difference = {}\n", "no limit; must have one of least, p5, medi"),
        (BODY + "[limits]\ntime_difference = { max = 1 }\n", "unknown entry 'max'; valid: from,"),
        (BODY + "[limits]\ntime_difference = 1\n", r"\[limits\]: time_difference: 1; must be a t"),
    ],
)
def test_a_mistake_is_one_line(read: Read, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read(text)


def done(study: Study, *times: float | None) -> Sweep:
    columns = ("time_to_contact[1]", "time_to_contact[2]", "time_difference")
    outcomes = (Outcome(k, dict.fromkeys(columns, t)) for k, t in enumerate(times))
    return Sweep(study, Path(), tuple(outcomes), 0)


def test_what_is_reached_is_a_statistic_of_all_runs(read: Read) -> None:
    plain, learning = read(BODY + LIMITS + TWO)
    found = reached([done(plain, 1.0, 1.2, 1.4), done(learning, 1.3, 1.2, 2.5)])
    assert [(r.variant, r.column, r.limit.statistic, r.value, r.kept) for r in found] == [
        ("as-it-is", "time_to_contact[1]", "p95", pytest.approx(1.38), True),
        ("as-it-is", "time_to_contact[2]", "p95", pytest.approx(1.38), True),
        ("as-it-is", "time_to_contact[1]", "greatest", 1.4, True),
        ("as-it-is", "time_to_contact[2]", "greatest", 1.4, True),
        ("learning", "time_to_contact[1]", "p95", pytest.approx(2.38), False),
        ("learning", "time_to_contact[2]", "p95", pytest.approx(2.38), False),
        ("learning", "time_to_contact[1]", "greatest", 2.5, False),
        ("learning", "time_to_contact[2]", "greatest", 2.5, False),
        ("learning", "time_difference", "median", pytest.approx(0.3), False),
    ]


def test_a_run_without_a_value_misses_the_limit(read: Read) -> None:
    (study,) = read(BODY + LIMITS)
    first = reached([done(study, 1.0, None, 1.1)])[0]
    assert first.value == pytest.approx(1.095)
    assert (first.missing, first.kept) == (1, False)
    none = reached([done(study, None, None, None)])[0]
    assert (none.value, none.missing, none.kept) == (None, 3, False)
    failed = Sweep(study, Path(), tuple(Outcome(k, {}, "plant: failed") for k in range(3)), 0)
    assert reached([failed])[0] == none
