"""Brings a folder of FMUs up to date with the sources."""

from pathlib import Path

from .folder import is_current, sources_hash, write_stamp
from .package import Built, write_file
from .shipped import SCRIPTS, slave_class


def build(out: Path) -> list[Built]:
    """Build the FMUs into the folder `out`, in alphabetical order, with their cross-check files.

    An FMU that is there already with the same content is left alone, and nothing is
    made at all where the stamp in the folder says that all is as it was built from these sources.
    An FMU that needs other packages has no cross-check files: it would be these that they check,
    and only where they are installed.
    """
    scripts = sorted(SCRIPTS.glob("*.py"))
    sources = sources_hash()
    if is_current(out, sources):
        return [Built(out / f"{script.stem}.fmu", "unchanged") for script in scripts]
    from .cross_check import cross_check_files  # only now: they take longer to load than that took
    from .package import build_fmu

    built = [build_fmu(script, out) for script in scripts]
    names = [fmu.path.name for fmu in built]
    for script in scripts:
        slave = slave_class(script)
        files = {} if slave.requires else cross_check_files(script.stem, slave.block)
        for name, data in files.items():
            write_file(out / name, data)
        names += files
    write_stamp(out, sources, names)
    return built
