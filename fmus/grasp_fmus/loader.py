"""Gives pythonfmu 0.7.0's loader what it needs for any number of instances to come and go."""

import ctypes
import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from threading import Lock
from typing import TYPE_CHECKING, Any
from weakref import ref

if TYPE_CHECKING:
    from .base import Slave


class Component:
    """Stands for the class that pythonfmu looks for: it makes instances, one alive at a time.

    pythonfmu asks the class, not the instance, to serialise a state.
    """

    def __init__(self, slave: "Callable[..., Slave]") -> None:
        self._slave = slave
        self._instance: ref[Slave]

    def __call__(self, **kwargs: Any) -> "Slave":
        """Make a fresh instance, at instantiation and at every reset."""
        instance = self._slave(self, **kwargs)
        self._instance = ref(instance)
        return instance

    def _fmu_state_to_bytes(self, snapshot: Any) -> bytes:
        return self._alive().state_to_bytes(snapshot)

    def _fmu_state_from_bytes(self, data: bytes) -> Any:
        try:
            return self._alive().state_from_bytes(data)
        except BaseException:
            release(data)  # pythonfmu keeps what it could not use
            raise

    def _alive(self) -> "Slave":
        instance = self._instance()
        assert instance is not None  # noqa: S101 - pythonfmu holds it as long as it calls
        return instance


_made: "dict[str, Once]" = {}
"""The class of each script that was imported."""


class Once(type):
    """The type of a slave: its class is made once, however often its script is run.

    pythonfmu imports the script and then runs it again at every instantiation, looks for the class
    among what that made, and keeps for good all that it learns of the classes there. So it finds
    none there, but a Component in the module, under the empty name for which it looks then. It also
    gives up a reference to the module's dictionary that it only borrowed, which makes the second or
    third instance crash: paid back here.
    """

    def __new__(cls, name: str, bases: tuple[type, ...], namespace: dict[str, Any]) -> Any:
        """Return the class when the script is imported, a Component when it is run again."""
        script = namespace["__module__"]
        if script not in _made:
            made = super().__new__(cls, name, bases, namespace)
            if bases and script in sys.modules:
                _made[script] = made
            return made
        component = Component(_made[script])
        module = sys.modules[script]
        setattr(module, "", component)
        keep(vars(module))
        return component


_forgetting = Lock()


def forget(resources: str) -> None:
    """Take the FMU's folder from the import path, where pythonfmu puts it and leaves it.

    Everything packed has been imported by the time there is an instance. pythonfmu does not give up
    its reference to the name either. Other threads of the host may change the path meanwhile.
    """
    with _forgetting, suppress(StopIteration, ValueError):
        entry = next(e for e in sys.path if e == resources)
        sys.path.remove(resources)
        if not any(e is entry for e in sys.path):
            release(entry)
    sys.path_importer_cache.pop(resources, None)


def survive(used: Iterable[object]) -> None:
    """Keep what pythonfmu's Windows binary gives up at an exception, but goes on using."""
    if sys.platform != "linux":  # where it is mended
        for item in used:
            keep(item)


def keep(used: object) -> None:
    """Add the reference to an object that pythonfmu gives up without owning it."""
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(used))


def release(unused: object) -> None:
    """Take away the reference to an object that pythonfmu owns and never gives up."""
    ctypes.pythonapi.Py_DecRef(ctypes.py_object(unused))
