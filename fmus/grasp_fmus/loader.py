"""What pythonfmu 0.7.0's loader needs, so that any number of instances can come and go."""

import ctypes
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any
from weakref import ref

if TYPE_CHECKING:
    from .slave import Fmi2Slave
    from .snapshot import Snapshot


class Component:
    """What pythonfmu takes for the class: it makes instances, one alive at a time.

    pythonfmu asks the class, not the instance, to serialise a state.
    """

    def __init__(self, slave: "Callable[..., Fmi2Slave]") -> None:
        self._slave = slave
        self._instance: ref[Fmi2Slave]

    def __call__(self, **kwargs: Any) -> "Fmi2Slave":
        """A fresh instance, at instantiation and at every reset."""
        instance = self._slave(self, **kwargs)
        self._instance = ref(instance)
        return instance

    def _fmu_state_to_bytes(self, snapshot: Any) -> bytes:
        return self._alive().state_to_bytes(snapshot)

    def _fmu_state_from_bytes(self, data: bytes) -> "Snapshot":
        return self._alive().state_from_bytes(data)

    def _alive(self) -> "Fmi2Slave":
        instance = self._instance()
        assert instance is not None  # noqa: S101 - pythonfmu holds it as long as it calls
        return instance


_made: "dict[str, Once]" = {}
"""The class of each script that was imported."""


class Once(type):
    """The type of a slave: its class is made once, however often its script is run.

    pythonfmu imports the script and then runs it again at every instantiation. It loses what it
    learns of the classes in it, and so would keep every class that were made. It then gives up a
    reference to the module's dictionary that it only borrowed, which makes the second or third
    instance crash: paid back here. And it takes the class from the module: what it finds there is
    a Component of its own.
    """

    def __new__(cls, name: str, bases: tuple[type, ...], namespace: dict[str, Any]) -> "Once":
        """The class of that name in the module that is being run."""
        script = namespace["__module__"]
        module = sys.modules.get(script)
        if not bases or module is None:
            return super().__new__(cls, name, bases, namespace)
        made = _made.get(script) or super().__new__(cls, name, bases, namespace)
        _made[script] = made
        keep(vars(module))
        setattr(module, name, Component(made))
        return made


def forget(resources: str) -> None:
    """Take the FMU's folder from the import path, where pythonfmu puts it and leaves it.

    Everything packed has been imported by the time there is an instance.
    """
    if resources in sys.path:
        sys.path.remove(resources)
    sys.path_importer_cache.pop(resources, None)


def keep(used: object) -> None:
    """Add the reference to an object that pythonfmu gives up without owning it."""
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(used))
