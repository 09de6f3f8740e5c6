"""Runs that a live page follows: what clients get, what they change, and the run again."""

import signal
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from grasp_cosim import InputError, Realtime, SimulationError, System, cli, load_run, simulate
from grasp_cosim.hil.served import Service
from grasp_cosim.live import live_page
from grasp_cosim.live.live_page import LivePage
from grasp_cosim.live.panel import panel_html, settings_of
from grasp_cosim.system.parts import Condition, Event, Limit, Port
from live.clients import WITHIN, ask, followed, following, history, request
from support.marks import engines
from support.proxies import ANY_PORT, build_proxy, serving

NAME, INPUT = "sensor_2.reflectance", "plant.force[1]"


def frames_until(frames, holds):
    """The frames until one of which something holds, with that one."""
    taken = []
    for frame in frames:
        taken.append(frame)
        if holds(frame):
            break
    return taken


def time_of(answered):
    """The time in s at which a request was done, from its line of the log."""
    _, answer = answered
    return float(answer["line"].split()[2])


@engines
@pytest.mark.parametrize("native", [False, True])
def test_a_change_is_in_the_log_and_in_run_json_which_repeats_the_run(
    grasp, engine, native, tmp_path
):
    system = grasp.natively(native).with_experiment(step=1e-3)

    def act(page):
        with following(page.address) as frames:
            frames_until(frames, lambda frame: frame["time"] >= 0.2)
            answers = [ask(page.address, NAME, 0.5), ask(page.address, "sensor_1.gain", 3e-3)]
            later = frames_until(frames, lambda frame: len(frame["lines"]) > 0)
            frames_until(frames, lambda frame: frame["time"] > time_of(answers[1]) + 0.1)
        return answers, later[-1]

    result, (answers, frame) = followed(system, act, engine=engine, realtime=Realtime(factor=2.0))
    (first, second) = (answer["line"] for status, answer in answers if status == 200)
    assert [*result.log[-2:]] == [first, second]
    assert frame["values"][NAME] == 0.5
    assert frame["lines"][0] == first
    changed, _ = result.settings["events"]
    assert changed["set"] == {NAME: 0.5}
    assert first == f"t = {changed['at']:.9g} s: {NAME} = 0.5"
    result.save(tmp_path)
    until = float(result.time[-1])
    again = simulate(System.load(tmp_path / "run.json"), stop=until)
    assert list(again) == list(result)
    assert all(again[name].tobytes() == result[name].tobytes() for name in result)
    plain = simulate(system, stop=until)
    differs = plain.time[plain["sensor_2.intensity"] != result["sensor_2.intensity"]]
    assert differs[0] == pytest.approx(changed["at"] + 1e-3, abs=1e-9)


def test_what_happens_in_the_run_is_told_while_it_goes_on(grasp):
    """An event of the system, and a limit that is exceeded."""
    event = Event({Port("sensor_1", "reflectance"): 0.9}, at_ns=10**8)
    limit = Limit(Condition(Port("plant", "gap[1]"), "<", 0.03), "warn")
    system = replace(grasp.with_experiment(step=1e-3), events=(event,), limits=(limit,))

    def act(page):
        with following(page.address) as frames:
            lines = []
            for frame in frames:
                lines += frame["lines"]
                if any("limits[0]" in line for line in lines):
                    break
        return lines, frame["state"]

    result, (lines, state) = followed(system, act, realtime=Realtime(factor=2.0))
    assert state == "running"
    assert "t = 0.1 s: sensor_1.reflectance = 0.9" in lines
    assert all(line in result.log for line in lines)


def test_a_value_that_does_not_fit_is_refused_and_the_old_one_stays(grasp):
    def act(page):
        refused = [
            ask(page.address, NAME, -1.0), ask(page.address, NAME, "much"),
            ask(page.address, "plant.object_width", 0.05), ask(page.address, "no.name", 1.0),
        ]  # fmt: skip
        return refused, ask(page.address, NAME, 1.0)

    result, (refused, taken) = followed(grasp, act)
    assert [status for status, _ in refused] == [422] * 4
    reasons = [answer["error"] for _, answer in refused]
    assert reasons[0] == f"set: {NAME}: reflectance = -1.0: must be a finite number from 0 to 10"
    assert "must be set before the run, --set plant.object_width=VALUE" in reasons[2]
    assert reasons[3].startswith("set: no.name: no component 'no'; valid: plant, sensor_1, ")
    assert taken[1]["value"] == 1.0
    assert len(result.settings["events"]) == 1


def test_values_that_do_not_fit_each_other_end_the_run_as_the_page_says(grasp):
    def act(page):
        with following(page.address) as frames:
            next(frames)
            status, _ = ask(page.address, "sensor_1.adc.range[1]", 100.0)
            last = [*frames][-1]
        return status, last

    outcome = []
    with pytest.raises(SimulationError, match=r"adc\.range = 100\.0, 10\.0 V: the second must be"):
        followed(grasp, lambda page: outcome.append(act(page)))
    ((status, last),) = outcome
    assert (status, last["state"], last["last"]) == (200, "failed", True)
    assert "the second must be above the first" in last["reason"]
    assert "such a refusal ends the run" in panel_html(settings_of(grasp))


def test_who_comes_late_gets_the_run_so_far_and_then_what_comes(grasp):
    def act(page):
        with following(page.address) as frames:
            frames_until(frames, lambda frame: frame["time"] >= 0.5)
        with following(page.address) as frames:
            first = next(frames)
            count, rows = history(page.address)
            later = frames_until(frames, lambda frame: frame["first"] > count)
        return first, count, rows, later

    result, (first, count, rows, later) = followed(grasp.natively(), act, step=1e-3)
    assert rows[0, 0] == 0.0
    assert rows[-1, 0] > 0.4
    assert first["first"] <= count
    numbers = [frame["first"] for frame in later]
    assert numbers == sorted(numbers)
    gap = 1 + [*result].index("plant.gap[1]")
    covered = result["plant.gap[1]"][: 5 * count]  # of so many rows a pair is made
    assert (rows[:, gap].min(), rows[:, gap].max()) == (covered.min(), covered.max())
    assert np.isin(rows[:, gap], covered).all()


def test_a_page_has_the_scene_the_parameters_and_no_foreign_resource(grasp):
    def act(page):
        with following(page.address) as frames:
            with_scene = frames_until(frames, lambda frame: "scene" in frame)
        return request(page.address), with_scene[-1]["scene"]

    _, ((status, body), scene) = followed(grasp, act, step=1e-3)
    html = body.decode()
    assert status == 200
    for text in ('id="fingers"', f'"name": "{NAME}"', 'id="find-parameter"', "class LiveRecording"):
        assert text in html
    assert "http://" not in html.replace("http://www.w3.org/2000/svg", "")
    assert "https://" not in html
    assert scene["state"]["contacts"] == []


def test_the_scene_learns_of_contacts(grasp):
    """As exactly as the rows are kept: here a pair stands for 0.1 s."""
    system = grasp.natively().with_experiment(step=1e-3)

    def act(page):
        with following(page.address) as frames:
            touched = frames_until(
                frames, lambda f: "scene" in f and len(f["scene"]["state"]["contacts"]) > 1
            )
        return touched[-1]["scene"]

    result, scene = followed(system, act, realtime=Realtime(factor=20.0))
    times = sorted(contact["t"] for contact in scene["state"]["contacts"][:2])
    assert times == pytest.approx(sorted(result.metrics["time_to_contact"]), abs=0.1)
    assert [mark[0] for mark in scene["marks"][:2]] == times


def test_a_proxy_shows_its_counters(grasp, tmp_path):
    fmu = grasp.component("sensor_1", "test").fmu
    with serving(fmu, Service(lockstep=True)) as server:
        system = grasp.with_experiment(step=4e-3)
        system = system.swap("sensor_1", build_proxy(fmu, tmp_path / "Bench.fmu", ANY_PORT))
        values = {"port": server.address[1], "timeout": 30.0}
        system = system.with_values({f"sensor_1.proxy.{n}": v for n, v in values.items()})

        def act(page):
            with following(page.address) as frames:
                return frames_until(frames, lambda f: f["links"] and f["time"] > 0.05)[-1]

        result, frame = followed(system, act, engine="python", realtime=Realtime(stall=60.0))
    link = frame["links"]["sensor_1"]
    assert (link["missed"], link["rejected"], link["state_now"]) == (0, 0, 1.0)
    assert 0.0 < link["round_trip_time_now"] <= link["round_trip_worst"]
    assert frame["overruns"] >= 0
    assert result.metrics["proxies"]["sensor_1"]["missed"] == 0


def test_a_client_that_takes_little_skips_rows_and_is_told_so(grasp, monkeypatch):
    """It is so far behind that what it lacks is not kept: it loads the history."""
    monkeypatch.setattr("grasp_cosim.live.feed.MAX_PAIRS", 16)
    monkeypatch.setattr(live_page, "MAX_FRAME_PAIRS", 4)
    system = grasp.natively().with_experiment(step=1e-3)

    def act(page):
        with following(page.address) as frames:
            missed, number = 0, next(frames)["first"]
            while missed < 3:
                frame = next(frames)
                missed += frame["first"] > number
                number = frame["first"] + 4
            return len(history(page.address)[1]), missed

    _, (rows, missed) = followed(system, act, realtime=Realtime(factor=20.0))
    assert missed == 3
    assert rows <= 2 * 3 * 16


def test_inputs_without_a_source_are_set_and_recorded_too(fmus, tmp_path):
    system = System(
        "plant only",
        components={
            "plant": {
                "fmu": fmus / "GripperPlant.fmu",
                "values": {"force[1]": 0.0, "force[2]": 0.0},
            }
        },
        experiment={"step": 1e-3, "stop": 1.0},
    )

    def act(page):
        with following(page.address) as frames:
            answered = ask(page.address, INPUT, -1)
            frames_until(frames, lambda frame: frame["time"] > time_of(answered) + 0.01)
        return answered, request(page.address)

    result, ((status, answer), (_, html)) = followed(system, act)
    assert (status, answer["value"]) == (200, -1.0)
    assert b'id="plots"' in html
    assert b'id="scene"' not in html  # it has no group of metrics, and so no view
    assert set(result[INPUT]) == {0.0, -1.0}
    result.save(tmp_path / "run")
    again = simulate(System.load(tmp_path / "run" / "run.json"), stop=float(result.time[-1]))
    assert list(again) == list(result)
    assert again["plant.position[1]"].tobytes() == result["plant.position[1]"].tobytes()


def test_a_system_without_numbers_that_can_be_set_says_so(grasp):
    assert "nothing that can be set" in panel_html([])
    (entry,) = [e for e in settings_of(grasp) if e["name"] == "sensor_1.surface"]
    assert entry["items"]
    hostile = {**entry, "variable": "<script>", "text": '"><b>', "items": {}, "value": "</p>"}
    html = panel_html([{**hostile, "kind": "String"}])
    assert "<script>" not in html
    assert "<b>" not in html


def test_a_page_of_a_run_that_fails_to_begin_ends(grasp):
    system = replace(grasp, name="other").with_values({"sensor_1.adc.range[1]": 100.0})
    page = LivePage(system)
    with pytest.raises(InputError, match="the second must be above the first"), page:
        simulate(page.system, realtime=True, listeners=[page.feed], requests=page.requests)
    assert page.page().startswith("<!DOCTYPE html>")


def test_the_command_prints_the_address_and_ctrl_c_ends_it(tmp_path):
    """The whole of it: a page is followed, a value is changed, and run.json repeats the run."""
    command = [sys.executable, "-m", "grasp_cosim", "run", "--realtime", "--show", "--step", "1e-3"]
    command += ["--stop", "600", "--out", str(tmp_path / "run")]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        try:
            address = next(line.split()[1] for line in process.stderr if line[:6] == "live: ")
            status, answer = ask(address, NAME, 0.5)
            with following(address) as frames:
                frames_until(frames, lambda frame: frame["time"] > time_of((status, answer)) + 0.1)
                process.send_signal(signal.SIGINT)
                last = [*frames][-1]
            process.wait(WITHIN)
        finally:
            process.kill()
    assert (process.returncode, status, answer["value"]) == (130, 200, 0.5)
    assert (last["state"], last["lines"], last["last"]) == ("interrupted", [], True)
    run = load_run(tmp_path / "run")
    until = repr(float(run.time[-1]))
    repeated = ["run", str(tmp_path / "run" / "run.json"), "--stop", until]
    assert cli.main([*repeated, "--out", str(tmp_path / "again")]) in (0, 1)
    again = load_run(tmp_path / "again")
    assert list(again) == list(run)
    assert all(again[name].tobytes() == run[name].tobytes() for name in run)
    assert answer["line"] in again.log


def test_a_page_needs_a_run_in_real_time(command):
    assert command("run", "--show") == (
        2, "", "grasp-cosim: --show: needs --realtime, the run that the page follows\n"
    )  # fmt: skip
