"""A group of metrics that is there for a test, as if its folder were in the package."""

import sys
from types import SimpleNamespace

from grasp_cosim.metrics import metric
from grasp_cosim.recording.result import OF_ANY
from grasp_cosim.system import description


def bring_group(monkeypatch, name, *metrics):
    for module in (description, metric):
        monkeypatch.setattr(module, "groups", lambda: ("grasp", name))
    has = {"metrics": SimpleNamespace(METRICS=metrics), "view": SimpleNamespace(VIEW=OF_ANY)}
    for part, module in has.items():
        monkeypatch.setitem(sys.modules, f"grasp_cosim.{name}.{part}", module)
    monkeypatch.setitem(sys.modules, f"grasp_cosim.{name}", SimpleNamespace())
