"""What upper packages give to lower ones: an object under a kind and a name.

No package imports one above it. A lower one that needs what an upper one makes, as a result needs
its picture, asks for it here when it is used. Three register it:

- the façade, grasp_cosim/__init__.py, what our own packages have. It is imported before any module
  below it, in every process, and needs no metadata of an installed distribution;
- an installed package of a user's, as an entry point in its pyproject.toml: the group of entry
  points is `grasp_cosim.` and the kind, and each names one object, `mine = "my_package:GROUP"`;
- a script, an object for the process that it runs in: see metrics.groups.register_group().
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any, Literal

from .errors import InputError, nearest

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

Kind = Literal["blocks", "groups", "html", "pictures", "readers", "twins"]
"""What is registered, under which names, and of which type it is:

blocks    ".py"               function of the file of a block: the path of its FMU, built and kept
groups    as in files         metrics.groups.Group: what is worked out and shown of a kind of system
html      name of a class     function of such an object: the HTML that a notebook shows
pictures  name of a class     function of such an object and a path, or None: a figure of matplotlib
readers   suffix of a file    function as ssp.from_archive.read_ssp: a System
twins     name of a class     function of a system and as of System.natively(): FMUs by component
"""

_LOADERS: dict[tuple[Kind, str], Callable[[], Any]] = {}
"""By kind and name a function that imports and returns one of our objects."""

_OBJECTS: dict[tuple[Kind, str], Any] = {}
"""What scripts registered in this process."""


def register(kind: Kind, name: str, load: Callable[[], Any]) -> None:
    """Register an object of our own packages, which `load` imports when it is first needed."""
    _LOADERS[kind, name] = load


def register_here(kind: Kind, name: str, item: Any) -> None:
    """Register an object in this process only, in the place of an older one that was, too.

    InputError for a name that our own packages have.
    """
    if (kind, name) in _LOADERS:
        raise InputError(f"{kind}: {name!r}: comes with grasp-cosim; must have another name")
    _OBJECTS[kind, name] = item


def registered(kind: Kind, name: str) -> Any:
    """The object under that name, from whoever registered it; InputError where nobody did.

    InputError, too, where the package of an entry point cannot be imported.
    """
    if (kind, name) in _LOADERS:
        return _LOADERS[kind, name]()
    if (kind, name) in _OBJECTS:
        return _OBJECTS[kind, name]
    check_registered(f"{kind}: no", kind, name)
    entry_point = _entry_points(kind)[name]
    try:
        return entry_point.load()
    except Exception as error:  # a module of others may raise anything
        message = " ".join(f"{type(error).__name__}: {error}".split())
        raise InputError(
            f"{kind}: {name!r}: {entry_point.value} cannot be imported: {message}"
        ) from error


def check_registered(place: str, kind: Kind, name: str) -> None:
    """InputError "PLACE 'name'; did you mean ...?" where nobody registered that name."""
    if (kind, name) not in _OBJECTS and not in_every_process(kind, name):
        raise InputError(f"{place} {name!r}; {nearest(name, names(kind))}")


def in_every_process(kind: Kind, name: str) -> bool:
    """True for what our own packages or installed ones have: any process finds it by its name."""
    return (kind, name) in _LOADERS or name in _entry_points(kind)


def here(kind: Kind) -> Mapping[str, Any]:
    """The objects of this process only, by name."""
    return {name: item for (of, name), item in _OBJECTS.items() if of == kind}


def names(kind: Kind) -> tuple[str, ...]:
    """All names of a kind, in alphabetical order."""
    packaged = (name for of, name in _LOADERS if of == kind)
    return tuple(sorted({*packaged, *here(kind), *_entry_points(kind)}))


@cache
def _entry_points(kind: Kind) -> Mapping[str, EntryPoint]:
    """Those of installed packages, by name."""
    from importlib.metadata import entry_points  # only here: 0.1 s, which few runs need

    return {point.name: point for point in entry_points(group=f"grasp_cosim.{kind}")}
