"""What is said of the proxies of a run, from made-up diagnostics."""

import numpy as np
from grasp_cosim.recording.proxies import proxy_figures, proxy_lines

TIME = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.5])


def diagnostics(**values):
    quiet = dict.fromkeys(
        (
            "missed",
            "consecutive_missed",
            "late",
            "out_of_order",
            "duplicated",
            "rejected",
            "age",
            "trips",
            "limited",
            "implausible",
            "lead",
        ),
        [0.0] * 6,
    )
    usual = {**quiet, "state": [1] * 6, "sessions": [1] * 6, "round_trip_time": [0.001] * 6}
    columns = {**usual, **values}
    signals = {f"arm.proxy.{name}": np.array(column) for name, column in columns.items()}
    return {"arm.angle": np.zeros(6), **signals}


def test_of_a_quiet_one_there_is_a_line():
    """None without proxies or a row; steps are counted though not each is recorded."""
    times = [0.0, 0.001, 0.001, 0.009, 0.001, 0.001]
    quiet = diagnostics(round_trip_time=times)
    said = "steps missed (0 in a row), 0 answers late; round trip 1 ms, at worst 9 ms"
    assert proxy_lines(TIME, quiet, 0.1) == [f"arm: 0 of 5 {said}"]
    assert proxy_lines(TIME, quiet, 0.01) == [f"arm: 0 of 50 {said}"]
    nothing = {name: column[:0] for name, column in quiet.items()}
    for time, signals in ((TIME, {"arm.angle": TIME}), (TIME[:0], nothing)):
        assert proxy_figures(time, signals) == {}
        assert proxy_lines(time, signals, 0.1) == []


def test_of_one_that_is_recorded_in_part_there_are_no_figures():
    signals = diagnostics()
    del signals["arm.proxy.age"]
    assert proxy_figures(TIME, signals) == {}


def test_a_loss_and_a_return_are_named():
    signals = diagnostics(
        state=[1, 2, 3, 4, 1, 3], missed=[0, 1, 2, 3, 0, 1], consecutive_missed=[0, 1, 2, 3, 0, 1],
        age=[0.0, 0.1, 0.2, 0.3, 0.0, -2.5], lead=[0.0, 0.0, 0.0, -0.3, 0.0, 0.2],
        trips=[0, 0, 1, 1, 0, 0], limited=[0, 1, 1, 2, 0, 3], implausible=[1] * 6,
    )  # fmt: skip
    (figures,) = proxy_figures(TIME, signals).values()
    assert figures["lost"] == [TIME[2], TIME[5]]
    assert figures["back"] == [TIME[4]]
    assert (figures["missed"], figures["most_in_a_row"], figures["ahead"]) == (4, 3, 2.5)
    assert (figures["lead"], figures["sessions"]) == (0.3, 2)
    assert proxy_lines(TIME, signals, 0.1)[:-1] == [
        "arm: the peer was lost at t = 0.2 s and came back at t = 0.4 s; its outputs were "
        "meanwhile as proxy.on_loss says",
        "arm: the peer was lost at t = 0.5 s and did not come back; its outputs were meanwhile as "
        "proxy.on_loss says, and with proxy.resume = true it may come back",
        "arm: the peer was started again, and its model set up from the start: 2 sessions in this "
        "run",
        "arm: the peer put itself into its safe state 1 time",
        "arm: 5 commands beyond the limits of the proxy: clamped",
        "arm: 1 answer dropped that cannot have been measured",
        "arm: the peer's clock was up to 2.5 s ahead of the run, which did not keep up",
    ]


def test_many_losses_are_not_all_listed():
    time = np.linspace(0.0, 3.9, 40)
    signals = {
        name: np.resize(column, 40) for name, column in diagnostics(state=[1, 3] * 3).items()
    }
    assert sum("lost at" in line for line in proxy_lines(time, signals, 0.1)) == 5
