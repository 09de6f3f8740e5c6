"""Makes the pages of the Python interface from the docstrings, with pdoc (in the extra dev).

.venv/bin/python docs/api.py [FOLDER]     # by default results/api; begin with index.html
"""

import importlib
import sys
import warnings
from pathlib import Path
from typing import Any

import grasp_cosim
from grasp_cosim.base.files import write_text
from pdoc import doc, render

MODULES = (
    "grasp_cosim",
    "grasp_cosim.metrics.metric",
    "grasp_cosim.exchange.listener",
    "grasp_cosim.recording.csv",
    "grasp_cosim.recording.mdf",
    "grasp_cosim.sweeps.sweep",
    "grasp_cosim.comparison.compare",
    "grasp_cosim.comparison.qualify",
    "grasp_cosim.comparison.bands",
)
"""What users import; the names of `grasp_cosim` itself are all that most need."""


def write_pages(folder: Path) -> list[Path]:
    """Write a page per module, and one that lists them; any warning is an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for name in grasp_cosim.__all__:
            getattr(grasp_cosim, name)  # imported when it is asked for
        pages = {name: doc.Module(importlib.import_module(name)) for name in MODULES}
        first = pages["grasp_cosim"]
        called: Any = grasp_cosim.simulate.__call__  # an object that is called
        taken_from = ("grasp_cosim.master.simulation", "simulate")
        first.members["simulate"] = doc.Function("grasp_cosim", "simulate", called, taken_from)
        render.configure(docformat="markdown", show_source=False, search=False)
        texts = {
            f"{name.replace('.', '/')}.html": render.html_module(page, pages)
            for name, page in pages.items()
        }
        texts["index.html"] = render.html_index(pages)
    for name, text in texts.items():
        write_text(folder / name, text)
    return [folder / name for name in texts]


def _file(module: str) -> str:
    return f"{module.replace('.', '/')}.html"


if __name__ == "__main__":
    for written in write_pages(Path(*sys.argv[1:] or ["results/api"])):
        print(written)
