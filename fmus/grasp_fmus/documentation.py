"""Names that have moved, until all that imports them has followed."""

from collections.abc import Mapping
from html import escape
from string import Template

from .page import FRAME, _rendered
from .page import icon as icon
from .page import licences as _licences

OURS = {"license.txt": "grasp-cosim"}


def licences(files: Mapping[str, str]) -> dict[str, bytes]:
    """As page.licences()."""
    return {file: next(iter(_licences(name).values())) for file, name in files.items()}


def framed(name: str, summary: str, card: str, version: str, fmi: str, sections: str) -> str:
    """As page.page()."""
    return Template(FRAME.read_text("utf-8")).substitute(
        name=escape(name),
        summary=escape(summary.rstrip(".")),
        version=escape(version),
        fmi=fmi,
        card=_rendered(card, 1),
        sections=sections,
    )
