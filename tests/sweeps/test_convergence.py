"""The observed order of results over steps."""

import pytest
from grasp_cosim.sweeps.table import Table, as_text, convergence, is_study, observed_order
from hypothesis import given
from hypothesis import strategies as st

STEPS = st.tuples(*[st.floats(1.1, 10.0)] * 2).map(lambda r: (1.0, r[0], r[0] * r[1]))


@given(steps=STEPS, order=st.floats(0.5, 3.5), c=st.sampled_from([-2.0, 0.3, 7.0]))
def test_an_error_that_is_a_power_of_the_step_has_that_order(steps, order, c):
    results = [5.0 + c * h**order for h in steps]
    assert observed_order(steps, results) == pytest.approx(order, abs=1e-6)


@pytest.mark.parametrize(
    "results", [(1.0, 1.0, 2.0), (1.0, 2.0, 1.0), (None, 1.0, 2.0), (1.0, 2.0, 2.0), (0, 1, 1e3)]
)
def test_results_that_show_no_order(results):
    assert observed_order((1.0, 2.0, 4.0), results) is None


def table(steps, **metrics):
    columns = {"index": list(range(len(steps))), "experiment.step": steps, **metrics}
    columns["error"] = [None] * len(steps)
    return Table(columns, ("experiment.step",), tuple(metrics), {"experiment.step": "s"})


def test_a_study_in_any_order_of_the_steps():
    made = table([4e-4, 1e-4, 2e-4], t=[1.4, 1.1, 1.2], never=[1.0, None, None])
    assert is_study(made)
    found = convergence(made)
    assert found["t"].finest == 1.1
    assert found["t"].steps == (2e-4, 4e-4)
    assert found["t"].errors == pytest.approx((0.1, 0.3))
    assert found["t"].order == pytest.approx(1.0)
    assert (found["never"].finest, found["never"].errors) == (None, (None, None))
    assert as_text(made).splitlines() == [
        "3 runs, 0 failed",
        "error against 0.1 ms    value  0.2 ms  0.4 ms  order",
        "t                         1.1     0.1     0.3      1",
        "never                       -       -       -      -",
    ]


def test_what_is_no_study():
    assert not is_study(table([1e-4]))
    assert not is_study(table([1e-4, 1e-4]))
    assert convergence(table([1e-4, 2e-4], t=[1.0, 2.0]))["t"].order is None
