"""The page of a recorded run, and the pictures beside it."""

from __future__ import annotations

import logging
from pathlib import Path

from one_piece import is_stream

from ..base.errors import InputError
from ..base.files import check_file, of_any_format, remove_parts
from ..recording.load import load_run, run_folder
from .page import write_page
from .timing import TIMING, draw_result

LOGGER = logging.getLogger(__name__)


def write_report(run: str | Path, out: str | Path | None = None, title: str = "") -> list[Path]:
    """Write the page of a run, by its folder, and the pictures that there are; where they are.

    The page is `out`, by default report.html in the folder, under the title that the run has or
    another one. With matplotlib a picture is beside it, and one of the timing of a run in real
    time. InputError where the folder has no run, or the page cannot be written.
    """
    folder = run_folder(Path(run))
    page = Path(out) if out else folder / "report.html"
    recorded = load_run(folder).titled(title)
    if recorded.wall_time is None:
        LOGGER.warning("%s: unfinished, to t = %.6g s", folder, recorded.time[-1])
    check_file(page)
    remove_parts(page.parent, page.name, *of_any_format(recorded.view.stem, TIMING))
    write_page(recorded, page, scene=recorded.view.scene(recorded))
    written = [page]
    if is_stream(page):
        return written
    try:
        written += draw_result(recorded, page.parent)
    except InputError as error:
        LOGGER.warning("no picture: %s", error)
    return written
