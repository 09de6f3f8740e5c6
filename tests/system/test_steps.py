"""Which steps, ends and times go together: each mistake in one line with what would do."""

import re

import pytest
from comparison.made import write_system
from grasp_cosim import InputError, System


def stepping(folder, step, stop, component=None, start=0):
    write_system(folder)
    text = (folder / "loop.toml").read_text()
    head, _, rest = text.partition("[experiment]")
    rest = rest[rest.index("[components") :]
    times = f"step = {step!r}\nstop = {stop!r}\nstart = {start!r}\n"
    own = f"step = {component!r}\n" if component else ""
    rest = rest.replace("[components.plant]\n", f"[components.plant]\n{own}")
    (folder / "loop.toml").write_text(f"{head}[experiment]\n{times}{rest}")
    return System.load(folder / "loop.toml")


@pytest.mark.parametrize(
    ("step", "stop", "component", "start"),
    [
        (0.001, 0.01, None, 0), (0.001, 0.01, 0.005, 0), (0.001, 0.01, 0.01, 0),
        ("1/3", 1, None, 0), ("1/30", 1, 0.1, 0), (0.25, 1.5, 0.5, 0.5), (0.001, 0.001, 0.001, 0),
    ],
)  # fmt: skip
def test_steps_that_go_into_each_other_are_taken(tmp_path, step, stop, component, start):
    assert stepping(tmp_path, step, stop, component, start)


@pytest.mark.parametrize(
    ("step", "stop", "component", "start", "said"),
    [
        (0.3, 1.0, None, 0, "step = 0.3 s does not divide stop = 1 s; stop could be 0.9 s"),
        (0.4, 1.0, None, 0, "does not divide stop = 1 s; stop could be 0.8 s"),
        (0.3, 1.1, None, 0, "stop could be 1.2 s"),
        (0.3, 0.1, None, 0, "step = 0.3 s does not divide stop = 0.1 s; stop could be 0.3 s"),
        (0.3, 1.0, None, 0.2, "divide stop = 1 s from start = 0.2 s; stop could be 1.1 s"),
        (0.3, 1.0, None, 1.0, "start = 1 s: must be before stop = 1 s"),
        (0.3, 1.0, None, 1.5, "start = 1.5 s: must be before stop = 1 s"),
        (0.25, 1.0, 0.3, 0, "plant: step = 0.3 s is not a whole multiple of the base step 0.25 s; "
         "could be 0.25 s"),
        (0.25, 1.0, 0.6, 0, "not a whole multiple of the base step 0.25 s; could be 0.5 s"),
        (0.25, 1.0, 0.1, 0, "not a whole multiple of the base step 0.25 s; could be 0.25 s"),
        (0.25, 1.0, 0.9, 0, "could be 1 s"),
        (0.25, 1.0, 0.75, 0, "plant: step = 0.75 s does not divide stop = 1 s; must end with a wh"),
        (0.25, 1.5, 1.0, 0.25, "step = 1 s does not divide stop = 1.5 s from start = 0.25 s; must"),
    ],
)  # fmt: skip
def test_a_mistake_names_what_would_do(tmp_path, step, stop, component, start, said):
    with pytest.raises(InputError, match=re.escape(said)) as caught:
        stepping(tmp_path, step, stop, component, start)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("rows", "exact"), [([0, 1, 2], True), ([0, 1, 10], False), ([0, 100], False), ([0, 9], True)]
)
def test_times_that_are_no_whole_nanoseconds_are_exact_as_far_as_they_are(tmp_path, rows, exact):
    """Steps of 1/999983 s: 2**53 counts of them last 9.007 s, and so must the stimuli."""
    stepping(tmp_path, "1/999983", "1/999983")
    lines = "".join(f"{time},0.0\n" for time in rows)
    (tmp_path / "drive.csv").write_text(f"time,plant.mass\n{lines}")
    if exact:
        assert System.load(tmp_path / "loop.toml", input=tmp_path / "drive.csv").input
        return
    with pytest.raises(
        InputError, match=r"times are exact until 9\.007 s; all must be before that"
    ):
        System.load(tmp_path / "loop.toml", input=tmp_path / "drive.csv")


def test_a_long_run_of_such_steps_is_refused(tmp_path):
    with pytest.raises(
        InputError, match=r"times are exact until 9\.007 s; all must be before that"
    ):
        stepping(tmp_path, "1/999983", 10)
    assert stepping(tmp_path, "1/999983", 9)
    assert stepping(tmp_path, 1e-3, 1e6)
