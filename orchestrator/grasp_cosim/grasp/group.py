"""The group "grasp": the metrics of a grasp, and its view."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..metrics.groups import Group
from .metrics import METRICS, check

if TYPE_CHECKING:
    from ..recording.result import View


def _view() -> View:
    from .view import VIEW  # only here: pictures take long to import

    return VIEW


GROUP = Group(METRICS, check, view=_view)
