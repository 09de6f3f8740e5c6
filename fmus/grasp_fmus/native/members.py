"""What a native FMU holds besides its binaries: description, sources, documentation, icon."""

from pathlib import Path
from string import Template

from ..documentation import OURS, framed, licences
from ..fmu import HASH, Model, hashed, python_members
from ..model_description import version
from .blocks import translated
from .description import build_description, native_description
from .sources import native_sources
from .targets import Version

TEMPLATE = Path(__file__).with_name("native.html.in")
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
    sections = Template(TEMPLATE.read_text("utf-8")).substitute(
        name=name, fmi=fmi, override=f"FMI{fmi}_OVERRIDE_FUNCTION_PREFIX"
    )
    page = framed(
        name, model.description.summary, model.card, version(), f"{fmi}.0", sections
    ).encode()
    return {
        **files,
        **({ICONS[fmi]: model.picture} if model.picture else {}),
        "documentation/index.html": page,
        **{f"documentation/licenses/{file}": text for file, text in licences(OURS).items()},
    }
