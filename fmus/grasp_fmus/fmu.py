"""Names that have moved, until all that imports them has followed."""

from pathlib import Path

from .package import HASH as HASH
from .package import Built, write_python
from .package import Model as Model
from .package import hashed as hashed
from .package import python_members as python_members
from .package import shipped_model as shipped_model
from .package import write_members as write_members


def write_fmu(target: Path, model: Model, _: str | None = None) -> Built:
    """As write_python()."""
    return write_python(target, model)
