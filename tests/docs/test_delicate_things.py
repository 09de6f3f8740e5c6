"""docs/position_control.py and the table of delicate.md, which docs/delicate_things.py makes."""

from pathlib import Path

import delicate_things
import position_control
import pytest
from position_control import Inputs, Params

PAGE = Path(delicate_things.__file__).with_name("how_to") / "delicate.md"


def run(p, place, n, h=1e-3):
    """Fingers of 0.5 kg in front of stiff walls at +- a place; what they do, by step."""
    x_1, x_2, v_1, v_2 = 0.11, -0.11, 0.0, 0.0
    x = position_control.initial_state(p, Inputs())
    for _ in range(n):
        u = Inputs((x_1, x_2), (v_1, v_2))
        x = position_control.step(p, x, u, h)
        f_1, f_2 = position_control.outputs(p, x, u).force
        for _ in range(10):
            wall_1, wall_2 = max(0.0, place[0] - x_1) * 1e4, max(0.0, x_2 - place[1]) * 1e4
            v_1 += 0.1 * h * (f_1 + wall_1 - 20.0 * v_1 * (wall_1 > 0.0)) / 0.5
            v_2 += 0.1 * h * (f_2 - wall_2 - 20.0 * v_2 * (wall_2 > 0.0)) / 0.5
            x_1, x_2 = x_1 + 0.1 * h * v_1, x_2 + 0.1 * h * v_2
        yield x, (x_1, x_2), (v_1, v_2), (f_1, f_2)


def test_position_control_closes_at_its_speed_waits_and_grips():
    p = Params(grip_force=2.0)
    states = list(run(p, (0.05, 0.0), 4000))
    before = 1000
    assert states[before][2] == pytest.approx((-0.05, 0.05), rel=1e-3)
    assert states[before][0].touched == (False, False)
    first = next(k for k, (x, *_) in enumerate(states) if x.touched == (True, False))
    both = next(k for k, (x, *_) in enumerate(states) if all(x.touched))
    assert 1e-3 * (both - first) == pytest.approx(0.05 / 0.05, rel=0.1)
    waiting = states[both - 100]
    assert waiting[1][0] == pytest.approx(0.05, abs=1e-3)
    assert abs(waiting[3][0]) < 1.0
    assert states[-1][3] == pytest.approx((-2.0, 2.0), abs=0.01)


@pytest.mark.slow
def test_the_table_of_the_page_is_that_of_the_script(tmp_path):
    rows = list(delicate_things.rows(tmp_path))
    text = PAGE.read_text("utf-8")
    assert len(rows) == len(delicate_things.THINGS)
    for row in rows:
        assert row in text, "run: docs/delicate_things.py"
    assert sum("damaged" in row for row in rows) == 2
    assert sum("dropped" in row for row in rows) == 1
    assert all(row.split("|")[-2].strip().startswith("survives") for row in rows)
