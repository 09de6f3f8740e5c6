"""The notebook runs from its first cell to its last, and gives what it shows."""

import copy
import json
import re
import runpy
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

DOCS = Path(__file__).parents[2] / "docs"
NOTEBOOK = json.loads((DOCS / "from_python.ipynb").read_text("utf-8"))
CODE = [cell for cell in NOTEBOOK["cells"] if cell["cell_type"] == "code"]


def without_outputs():
    blank = copy.deepcopy(NOTEBOOK)
    for cell in blank["cells"]:
        if cell["cell_type"] == "code":
            cell |= {"outputs": [], "execution_count": None}
    return blank


def texts(cell):
    """What a cell prints and shows, but for how long it took and where lines break."""
    found = ["".join(o.get("text") or o["data"]["text/plain"]) for o in cell["outputs"]]
    return [" ".join(re.sub(r"took \S+ s", "took", text).split()) for text in found]


def test_without_jupyter_it_gives_what_it_shows(checkout):
    pytest.importorskip("matplotlib")
    pytest.importorskip("pandas")
    done = runpy.run_path(str(DOCS / "notebook.py"))["executed"](without_outputs())
    ran = [cell for cell in done["cells"] if cell["cell_type"] == "code"]
    assert [texts(cell) for cell in ran] == [texts(cell) for cell in CODE]
    kinds = [sorted(o["data"]) for cell in ran for o in cell["outputs"] if "data" in o]
    assert ["image/png", "text/plain"] in kinds
    assert kinds.count(["text/html", "text/plain"]) == 2


def test_a_cell_that_fails_stops_it(checkout):
    broken = {"cells": [{"cell_type": "code", "source": ["1 / 0"]}]}
    with pytest.raises(ZeroDivisionError):
        runpy.run_path(str(DOCS / "notebook.py"))["executed"](broken)


def test_jupyter_runs_it_too(checkout):
    nbclient = pytest.importorskip("nbclient", reason="nbclient is not installed")
    pytest.importorskip("ipykernel", reason="ipykernel is not installed")
    nbformat = pytest.importorskip("nbformat", reason="nbformat is not installed")
    notebook = nbformat.reads(json.dumps(without_outputs()), as_version=4)
    there = {"metadata": {"path": str(checkout)}}
    nbclient.NotebookClient(notebook, timeout=120, resources=there).execute()
    ran = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert [texts(cell)[0] for cell in ran] == [texts(cell)[0] for cell in CODE]


def test_it_is_a_valid_notebook_of_a_modest_size():
    nbformat = pytest.importorskip("nbformat", reason="nbformat is not installed")
    nbformat.validate(nbformat.from_dict(NOTEBOOK))
    assert (DOCS / "from_python.ipynb").stat().st_size < 500_000
    assert all(cell["outputs"] for cell in CODE)
