"""What a lower room takes from a higher one: by name, when it is called for.

Those are the reader of archives, the pictures, tables and words of what is shown, and a group: a
folder of this package with what is its own of any system that names it, `metrics.py` with METRICS
and `view.py` with a VIEW. A system file names groups as `metrics = ["grasp"]`.
"""

from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType

PACKAGE = __name__.partition(".")[0]


def higher(module: str) -> ModuleType:
    """The module of that name in this package, like "report.plot"."""
    return import_module(f"{PACKAGE}.{module}")


@cache
def groups() -> tuple[str, ...]:
    """The names of the groups that there are."""
    package = Path(__file__).parent.parent
    folders = {file.parent for file in package.glob("*/view.py")}
    return tuple(sorted(f.name for f in folders if (f / "metrics.py").is_file()))
