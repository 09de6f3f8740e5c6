"""run.json with anything else in it: it reads, or one line says what is wrong, no traceback."""

import copy
import json
from dataclasses import replace

import pytest
from grasp_cosim import InputError, Realtime, metric, simulate
from grasp_cosim.comparison.compare import compare
from grasp_cosim.comparison.comparison_page import write_comparison
from grasp_cosim.recording.folder import RunFolder
from grasp_cosim.recording.read_back import load_run
from grasp_cosim.report import terminal
from grasp_cosim.report.html_tables import result_html
from grasp_cosim.report.run_report import write_report
from grasp_cosim.system.scenario import read_events, read_faults
from hypothesis import assume, given
from hypothesis import strategies as st
from support.marks import examples

FAULT = {
    "connection": "sensor_1.intensity -> controller.intensity[1]", "kind": "noise",
    "standard_deviation": 0.002, "from": 0.005, "until": 0.015,
    "when": "plant.contact[2] == false",
}  # fmt: skip
EVENT = {"at": 0.01, "set": {"sensor_1.reflectance": 0.5}}
OTHERS = st.one_of(
    st.sampled_from([None, True, 0, -1, 1.5, 1e308, 10**18, 10**400, "", "text", [], {}]),
    st.sampled_from([float("inf"), float("nan"), [1], ["a"], [[1]], {"a": 1}, {"a": {"b": None}}]),
    st.recursive(st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=3),
                 lambda inner: st.lists(inner, max_size=2)
                 | st.dictionaries(st.text(max_size=3), inner, max_size=2), max_leaves=4),
)  # fmt: skip


@metric("start", entries=("first", "last"))
def start(run):
    """A name that the settings have, too."""
    return [float(run["plant.gap[1]"][0]), float(run["plant.gap[1]"][-1])]


@metric("input", unit="m")
def input_(run):
    return float(run["plant.gap[1]"][0])


@pytest.fixture(scope="module")
def runs(grasp, tmp_path_factory):
    """The folders of a whole run, one of every third step and one by the clock; with their JSON."""
    system = grasp.with_experiment(1e-3, 0.02)
    faults = read_faults("f", [FAULT], system.connections)
    system = replace(system, events=read_events("e", [EVENT]), faults=faults)
    made = []
    for every, realtime in ((1, False), (3, False), (1, Realtime(factor=50.0))):
        place = tmp_path_factory.mktemp("run")
        with RunFolder(place, system, ["run"], paced=bool(realtime)) as folder:
            result = simulate(system, listeners=[folder], every=every, realtime=realtime,
                              metrics=[start, input_])  # fmt: skip
            folder.finish(result)
        made.append((place, json.loads((place / "run.json").read_text())))
    return made


def places(value, place=()):
    """All places in JSON, of long lists those of the first entries."""
    if place:
        yield place
    entries = value.items() if isinstance(value, dict) else enumerate(value[:3])
    for key, entry in entries:
        if isinstance(entry, dict | list):
            yield from places(entry, (*place, key))
        else:
            yield (*place, key)


def with_another(written, data):
    """The JSON with another value in a place, or without one."""
    changed = copy.deepcopy(written)
    *above, last = data.draw(st.sampled_from(sorted(places(written), key=str)))
    entry = changed
    for key in above:
        entry = entry[key]
    if data.draw(st.booleans()):
        other = data.draw(OTHERS)
        assume(type(other) is not type(entry[last]) or other != entry[last])
        entry[last] = other
    else:
        del entry[last]
    return changed


def read_anew(runs, data, tmp_path_factory, use):
    folder, written = data.draw(st.sampled_from(runs))
    changed = tmp_path_factory.getbasetemp() / "changed"
    changed.mkdir(exist_ok=True)
    (changed / "signals.csv").write_bytes((folder / "signals.csv").read_bytes())
    (changed / "run.json").write_text(json.dumps(with_another(written, data)))
    try:
        use(changed)
    except InputError as error:
        said = str(error)
    else:
        return
    assert "\n" not in said
    assert str(changed) in said or "metric" in said


@examples(60)
@given(data=st.data())
def test_it_reads_or_one_line_says_what_is_wrong(runs, tmp_path_factory, data):
    def use(folder):
        run = load_run(folder)
        assert run.metrics["steps"] == 20
        assert repr(run)
        assert terminal.run_text(run)
        assert result_html(run)

    read_anew(runs, data, tmp_path_factory, use)


@pytest.mark.slow
@examples(60)
@given(data=st.data())
def test_so_do_pages_and_comparisons(runs, tmp_path_factory, data):
    def use(folder):
        write_report(folder, folder / "report.html")
        write_comparison(compare(runs[0][0], folder), folder / "compare.html")

    read_anew(runs, data, tmp_path_factory, use)


def test_metrics_of_any_name_are_read_back_as_they_were(runs):
    for folder, written in runs:
        run = load_run(folder)
        assert (run.settings.get("start"), "input" in run.settings) == (None, False)
        assert run.metrics["start"] == written["measured"]["start"]
        assert run.metrics["input"] == written["measured"]["input"]
        assert run.metric_units["input"] == "m"
        assert run.metrics["steps"] == 20


@pytest.mark.parametrize("values", [[0.1], 0.1, None])
def test_a_metric_of_thinned_rows_has_as_many_values_as_it_had(runs, tmp_path, values):
    folder, written = runs[1]
    (tmp_path / "signals.csv").write_bytes((folder / "signals.csv").read_bytes())
    written = {**written, "measured": {**written["measured"], "time_to_contact": values}}
    (tmp_path / "run.json").write_text(json.dumps(written))
    with pytest.raises(InputError, match=r"measured: time_to_contact = .*; must be 2 values"):
        load_run(tmp_path)


def test_the_clock_of_a_system_is_read_though_its_run_did_not_keep_to_it(grasp, tmp_path):
    system = replace(grasp.with_experiment(1e-3, 0.01), realtime=Realtime(factor=2.0))
    with RunFolder(tmp_path, system) as folder:
        folder.finish(simulate(system, listeners=[folder]))
    assert load_run(tmp_path).timing is None


@pytest.mark.parametrize(
    ("entry", "value"),
    [("tolerance", "1e-6"), ("logging", "logEvents"), ("logging", []), ("logging", [1])],
)
def test_a_wrong_entry_of_a_component_is_named(runs, tmp_path, entry, value):
    folder, written = runs[0]
    (tmp_path / "signals.csv").write_bytes((folder / "signals.csv").read_bytes())
    changed = copy.deepcopy(written)
    changed["components"]["plant"][entry] = value
    (tmp_path / "run.json").write_text(json.dumps(changed))
    with pytest.raises(InputError, match=rf"run.json: components: plant: {entry} = .*; must be "):
        load_run(tmp_path)


@pytest.mark.parametrize("end", ["from", "to"])
@pytest.mark.parametrize("number", [0, 3])
def test_a_connection_of_no_component_is_named(runs, tmp_path, end, number):
    folder, written = runs[0]
    changed = copy.deepcopy(written)
    changed["connections"][number][end] = "sensr_1.gap"
    (tmp_path / "signals.csv").write_bytes((folder / "signals.csv").read_bytes())
    (tmp_path / "run.json").write_text(json.dumps(changed))
    said = rf"connections\[{number}\]: {end} = 'sensr_1\.gap': no component"
    with pytest.raises(InputError, match=said):
        load_run(tmp_path)
