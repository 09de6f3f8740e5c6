"""What the page on sessions tells a user to write runs."""

import pytest
from docs.test_pages import blocks
from grasp_cosim import System
from grasp_cosim.grasp.presets import SYSTEM
from support.native_fmus import needs_gcc


@pytest.mark.slow
@needs_gcc
def test_the_page_on_sessions(natives, monkeypatch):
    pytest.importorskip("gymnasium")
    import grasp_cosim

    monkeypatch.setattr(grasp_cosim, "grasp_system", lambda: System.load(SYSTEM, natives))
    names = {}
    for block in blocks("docs/how_to/step_by_hand.md", "python"):
        exec(block, names)
    assert names["result"].ended_at is not None
    assert names["terminated"].shape == (3,)
