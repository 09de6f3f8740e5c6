"""Executes docs/from_python.ipynb and keeps what its cells show, without Jupyter.

    .venv/bin/python docs/notebook.py     # in the folder of the checkout

What a cell prints and what its last line is are kept as Jupyter keeps them.
"""

import ast
import base64
import json
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

from grasp_cosim.base.files import write_text

NOTEBOOK = Path(__file__).parent / "from_python.ipynb"

FORMS = {"text/html": "_repr_html_", "image/png": "_repr_png_"}
"""How an object shows itself in a notebook, by the kind of what it gives."""


def executed(notebook: dict[str, Any]) -> dict[str, Any]:
    """The notebook with the outputs of its cells, run one after the other from the first."""
    names: dict[str, Any] = {"__name__": "__main__"}
    cells, count = [], 0
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            count += 1
            outputs = _outputs("".join(cell["source"]), names, count)
            cell = {**cell, "execution_count": count, "outputs": outputs}
        cells.append(cell)
    return {**notebook, "cells": cells}


def _outputs(source: str, names: dict[str, Any], count: int) -> list[dict[str, Any]]:
    """What a cell prints, and what its last line is, if that is an expression."""
    tree, printed, shown = ast.parse(source), StringIO(), None
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    with redirect_stdout(printed):
        exec(compile(tree, "cell", "exec"), names)  # noqa: S102 - our own notebook
        if isinstance(last, ast.Expr):
            shown = eval(compile(ast.Expression(last.value), "cell", "eval"), names)  # noqa: S307
    outputs: list[dict[str, Any]] = []
    if text := printed.getvalue():
        outputs.append({"output_type": "stream", "name": "stdout", "text": _lines(text)})
    if shown is not None:
        result = {"output_type": "execute_result", "execution_count": count, "metadata": {}}
        outputs.append({**result, "data": _data(shown)})
    return outputs


def _data(shown: Any) -> dict[str, Any]:
    """An object in each form that it has."""
    found: dict[str, Any] = {"text/plain": _lines(repr(shown))}
    for kind, method in FORMS.items():
        made = getattr(shown, method, lambda: None)()
        if isinstance(made, bytes):
            found[kind] = base64.b64encode(made).decode("ascii")
        elif made is not None:
            found[kind] = _lines(made)
    return found


def _lines(text: str) -> list[str]:
    return text.splitlines(keepends=True)


if __name__ == "__main__":
    done = executed(json.loads(NOTEBOOK.read_text("utf-8")))
    write_text(NOTEBOOK, json.dumps(done, indent=1, ensure_ascii=False) + "\n")
