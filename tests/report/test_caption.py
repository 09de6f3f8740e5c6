"""What pictures and pages say of themselves."""

import pytest
from grasp_cosim.base.errors import InputError
from grasp_cosim.recording.load import load_run
from grasp_cosim.report.caption import about, caption, changes
from report.runs import grasp_run, ring_run, write_run


def test_a_title_is_the_one_asked_for_else_that_of_the_run_else_what_it_is(tmp_path):
    run = grasp_run()
    assert caption(run).title == "grasp, case 2, GraspController"
    assert caption(ring_run(["a"])).title == "grasp"
    write_run(tmp_path / "results", run.titled("Before lunch"))
    kept = load_run(tmp_path / "results")
    assert caption(kept).title == "Before lunch"
    assert caption(kept, "After").title == caption(kept.titled("After")).title == "After"


def test_many_changes_are_counted():
    assert changes({}) == "as in the system file"
    assert changes({"a": True, "b": 0.1, "c": "x.fmu"}) == "a = true, b = 0.1, c = x.fmu"
    assert changes({f"v{k}": k for k in range(8)}).endswith("v5 = 5, 2 more")


@pytest.mark.parametrize("epoch", ["today", "1e9", "-1" + 30 * "0"])
def test_a_date_that_is_none(epoch, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", epoch)
    with pytest.raises(InputError, match=rf"^SOURCE_DATE_EPOCH={epoch}: must be the seconds"):
        about({})
