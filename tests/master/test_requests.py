"""What other threads ask of a run: when it is done, what it changes, and what is refused."""

import threading
from dataclasses import replace

import pytest
from grasp_cosim import InputError, Realtime, SimulationError, simulate
from grasp_cosim.fmi.instance import RefusedValueError
from grasp_cosim.master.master import Master
from grasp_cosim.master.requests import MAX_WAITING, Requests
from grasp_cosim.system.parts import Port
from grasp_cosim.system.scenario import read_events
from support.marks import engines
from support.mocks import Mock, make_system

NAME, OTHER = "sensor_2.reflectance", "controller.contact_force.stiffness"


def repeated(system, result, **options):
    """The run with the events that the result has."""
    events = read_events("run.json", result.settings["events"])
    return simulate(replace(system, events=events), **options)


def same_bits(one, two):
    return list(one) == list(two) and all(one[n].tobytes() == two[n].tobytes() for n in one)


class AskAt:
    """A listener that asks, from the thread that hands rows on, once a step is reached."""

    def __init__(self, requests, asked):
        self.requests, self.asked, self.answers = requests, dict(asked), []

    def begin(self, experiment, signals):
        pass

    def block(self, steps, rows):
        for step in [s for s in self.asked if s <= steps[-1]]:
            self.answers += [self.requests.ask(*pair) for pair in self.asked.pop(step)]

    def end(self, complete):
        pass


@engines
@pytest.mark.parametrize("native", [False, True])
@pytest.mark.parametrize("realtime", [False, Realtime(factor=5.0)])
def test_a_request_is_an_event_of_the_run_which_repeats_it(grasp, engine, native, realtime):
    system = grasp.natively(native).with_experiment(step=1e-3, stop=1.5)
    requests = Requests(system)
    listener = AskAt(requests, {0: [(NAME, 0.9)], 300: [(NAME, 0.5), (OTHER, 50.0), (NAME, 0.6)]})
    result = simulate(
        system, engine=engine, realtime=realtime, listeners=[listener], requests=requests
    )
    first, *later = [answer.result(0) for answer in listener.answers]
    assert [a.value for a in (first, *later)] == [0.9, 0.5, 50.0, 0.6]
    assert 0.0 <= first.time <= later[0].time == later[1].time == later[2].time < 1.5
    assert later[0].time >= 0.3
    assert [*result.log] == [a.line for a in (first, *later)]
    assert [e["set"] for e in result.settings["events"]] == [
        {NAME: 0.9}, {NAME: 0.5}, {OTHER: 50.0}, {NAME: 0.6}
    ]  # fmt: skip
    assert same_bits(result, repeated(system, result))
    plain = simulate(system)
    differs = result["sensor_2.intensity"] != plain["sensor_2.intensity"]
    assert plain.time[differs][0] == pytest.approx(first.time + 1e-3, abs=1e-9)


def test_they_come_behind_the_events_of_the_system_and_at_points_of_the_component(grasp):
    entries = [
        {"at": 0.004, "set": {NAME: 0.8}},
        {"when": "plant.gap[1] > 0", "set": {"sensor_1.reflectance": 0.7}},
    ]
    system = replace(grasp, events=read_events("test", entries))
    system = system.with_settings({"components.sensor_2.step": "4e-3"})
    options = {"step": 1e-3, "stop": 0.02}
    requests = Requests(system)
    with simulate.session(system, requests=requests, **options) as session:
        session.step(3)
        answer = requests.ask(NAME, 0.4)
        session.step(1)
        assert not answer.done()
        session.step(1)
        assert answer.result(0)[:2] == (0.004, 0.4)
        while session.step():
            pass
        result = session.result()
    assert [e.get("at") for e in result.settings["events"]] == [0.004, None, 0.004]
    steered = system.as_steered()
    assert same_bits(result, repeated(steered, result, **options))


def test_a_step_that_is_no_whole_number_of_nanoseconds_is_met_exactly(grasp):
    system = grasp.with_experiment(step="1/4096", stop="37/4096")
    for steps in (1, 7, 23):
        requests = Requests(system)
        with simulate.session(system, requests=requests, steered=False) as session:
            session.step(steps)
            requests.ask(NAME, 0.4)
            while session.step():
                pass
            result = session.result()
        assert same_bits(result, repeated(system, result))


def test_what_does_not_fit_is_refused_in_the_thread_that_asks(grasp):
    requests = Requests(grasp)
    for name, value, reason in (
        (NAME, -1.0, "reflectance = -1.0: must be a finite number from 0 to 10"),
        (NAME, "much", "must be"),
        ("sensor_2.gap", 0.1, "is an input with a connection"),
        ("plant.object_width", 0.1, "must be set before the run"),
        ("sensor_9.gap", 0.1, "no component 'sensor_9'"),
        ("reflectance", 0.1, "must be 'component.variable'"),
        ("plant.finger_mass", 0.5, "which must be set one by one"),
    ):
        with pytest.raises(InputError, match=f"^set: {name}.*{reason}") as refusal:
            requests.ask(name, value)
        assert "\n" not in str(refusal.value)
    for _ in range(MAX_WAITING):
        requests.ask(NAME, 0.5)
    with pytest.raises(InputError, match=f"{MAX_WAITING} requests wait; must be asked later"):
        requests.ask(NAME, 0.5)


def test_what_was_not_done_before_the_end_is_told_so(grasp):
    requests = Requests(grasp)
    with simulate.session(grasp, step=1e-3, stop=0.01, requests=requests) as session:
        while session.step():
            pass
        answer = requests.ask(NAME, 0.5)
        assert session.result().settings["events"] == []
        with pytest.raises(InputError, match="a run that takes requests cannot go back"):
            session.save()
    assert str(answer.exception(0)) == f"set: {NAME}: the run ended before"
    with pytest.raises(InputError, match="the run has ended; must be asked while it goes on"):
        requests.ask(NAME, 0.5)


class Choosy(Mock):
    """Refuses what is negative, and fails at what is more than 10."""

    def set(self, variables, values):
        if values[0] < 0.0:
            raise RefusedValueError(f"{self.name} keeps the older one")
        if values[0] > 10.0:
            raise self.failure(3, self.time)
        super().set(variables, values)


def test_an_fmu_that_refuses_a_value_keeps_the_run_going_and_one_that_fails_does_not(tmp_path):
    mock = Choosy(tmp_path, "a", lambda u, _: u)
    system = make_system([mock], [])
    requests = Requests(system)
    master = Master(system, [mock], lambda *_: None, "python", requests=requests)
    master.initialise()
    refused, taken = requests.ask("a.p", -1.0), requests.ask("a.p", 2.0)
    assert master.advance(1) == 1
    with pytest.raises(InputError, match=r"^set: a\.p: a keeps the older one$"):
        refused.result(0)
    assert taken.result(0) == (0.0, 2.0, "t = 0 s: a.p = 2.0")
    assert mock.p == 2.0
    assert [event.set for event in master.scenario.done_requests] == [{Port("a", "p"): 2.0}]
    failed = requests.ask("a.p", 11.0)
    with pytest.raises(SimulationError, match="a: status 3"):
        master.advance(1)
    assert isinstance(failed.exception(0), SimulationError)


def test_a_run_that_goes_on_alone_is_stopped_between_two_steps_for_it(grasp):
    """From another thread, as a server does; the run is long, and ends when it has the answer."""
    system = grasp.natively().with_experiment(step=1e-3, stop=600.0)
    requests, halt, answers = Requests(system), threading.Event(), []

    def ask():
        answers.extend(requests.ask(NAME, value).result(60) for value in (0.5, 0.25))
        halt.set()

    thread = threading.Thread(target=ask)
    thread.start()
    result = simulate(system, realtime=True, requests=requests, halt=halt)
    thread.join()
    first, second = answers
    assert (first.value, second.value) == (0.5, 0.25)
    assert first.time < second.time <= result.time[-1]
    until = float(result.time[-1])
    again = repeated(system, result, stop=until)
    assert again["sensor_2.intensity"].tobytes() == result["sensor_2.intensity"].tobytes()
