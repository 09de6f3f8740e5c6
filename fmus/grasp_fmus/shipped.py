"""The FMUs that come with this package: one for each script."""

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

SCRIPTS = Path(__file__).parent / "scripts"


class Script:
    """What a script in SCRIPTS says of an FMU."""

    block: Any
    requires: tuple[str, ...] = ()
    """Packages that the block imports when its first state is made; not packed."""


def slave_class(script: Path) -> Any:
    """Return the class in a script, which has the script's name."""
    spec = spec_from_file_location(script.stem, script)
    if spec is None or spec.loader is None:
        raise ImportError(f"{script}: must be a Python file")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return getattr(module, script.stem)


def blocks() -> dict[str, Any]:
    """Return the blocks, which are modules, by the names of their FMUs, in alphabetical order."""
    return {script.stem: slave_class(script).block for script in sorted(SCRIPTS.glob("*.py"))}
