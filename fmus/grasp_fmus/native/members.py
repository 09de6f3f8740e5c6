"""What a native FMU holds besides its binaries: description, sources, documentation, icon."""

from ..package import HASH, Model, hashed, python_members
from ..page import NATIVE, licences, page
from .blocks import translated
from .description import build_description, native_description
from .sources import native_sources
from .targets import Version

ICONS = {2: "model.png", 3: "terminalsAndIcons/icon.png"}


def native_members(model: Model, fmi: Version) -> dict[str, bytes]:
    """Return the files of a native FMU but for its binaries, by name.

    Its GUID is a hash of description and sources, the same whatever it is compiled for and on. Its
    states name the content of the FMU of the same block in Python, with which it exchanges them.
    UntranslatableError, one line, where the block holds what cannot be translated.
    """
    name = model.description.name
    content, _ = python_members(model)
    translation = translated(name, model.block, model.file)
    sources = native_sources(name, translation, content, HASH, fmi)
    _, files = hashed(
        {
            "modelDescription.xml": native_description(model.description, HASH, fmi),
            "sources/buildDescription.xml": build_description(name, fmi),
            **{f"sources/{file}": data for file, data in sources.items()},
        }
    )
    html = page(name, model.description.summary, model.card, NATIVE, fmi)
    return {
        **files,
        **({ICONS[fmi]: model.picture} if model.picture else {}),
        "documentation/index.html": html.encode(),
        **licences("grasp-cosim"),
    }
