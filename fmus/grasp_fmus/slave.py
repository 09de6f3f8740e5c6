"""The slave that runs a block behind pythonfmu's FMI 2.0 interface.

Value references are positions in one list of values: inputs, outputs, parameters, in the order of
declaration. Outputs are worked out when they are asked for, from the state and the inputs of that
moment, so they agree with the inputs in initialisation mode and after every set.
"""

import atexit
import ctypes
import os
import sys
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from pythonfmu import Fmi2Slave

from .contract import Block, build_params, count, declared, packer, unpacker
from .model_description import model_description


class ParameterError(ValueError):
    """Parameters that the block refuses. pythonfmu logs the repr: here, just the message."""

    def __repr__(self) -> str:
        return str(self)


_libraries: set[str] = set()
"""The binaries whose state is put in order when Python ends."""


def _finalize_at_exit(resources: str | None) -> None:
    """See to it that the process can end in peace, if these are the resources of an FMU.

    The binary of pythonfmu 0.7.0 releases its state twice when the process ends, once in freed
    memory, which corrupts the heap of the host. Its own function, called before, prevents that.
    """
    binaries = Path(resources or "").parent / "binaries" / "linux64"
    for library in map(str, binaries.glob("*.so")):
        if library not in _libraries:
            _libraries.add(library)
            atexit.register(_finalize, library)


def _finalize(library: str) -> None:
    try:
        loaded = ctypes.CDLL(library, mode=os.RTLD_NOLOAD | os.RTLD_NOW)
    except OSError:
        return  # unloaded meanwhile: its state went with it
    loaded.finalizePythonInterpreter()


class BlockSlave(Fmi2Slave):  # type: ignore[misc]
    """A block as an FMI 2.0 co-simulation slave; a subclass names the block."""

    block: Block

    def __init_subclass__(cls) -> None:
        """Keep the script's namespace alive.

        pythonfmu 0.7.0 runs the script again at every instantiation and then gives up a reference
        to the module's dictionary that it only borrowed, so that the second or third instance
        crashes. This hook runs as often as the script does and pays that reference back.
        """
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(vars(sys.modules[cls.__module__])))

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        _finalize_at_exit(kwargs.get("resources"))
        self._fields = declared(self.block)
        self._values: list[Any] = [start for f in self._fields for start in f.starts]
        self._references = list(range(len(self._values)))
        self._first_parameter = count(self._fields, "input", "output")
        self._outputs = slice(count(self._fields, "input"), self._first_parameter)
        self._pack = packer(self.block.Inputs, self._fields)
        self._unpack = unpacker(self._fields)
        self._step, self._evaluate = self.block.step, self.block.outputs
        self._params: Any = None
        self._inputs: Any = None  # None: something was set and the outputs are out of date
        self._state: Any = None
        self._initialised = False

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        """The model description, from the block's declaration."""
        guid = type(self).__module__.rpartition("_")[2]
        return model_description(
            type(self).__name__, (type(self).__doc__ or "").rstrip("."), self._fields, guid
        )

    def enter_initialization_mode(self) -> None:
        """Refuse parameters set so far that the block refuses."""
        self._refresh()

    def exit_initialization_mode(self) -> None:
        """Fix the initial state from the parameters and inputs set so far."""
        self._refresh()
        self._initialised = True

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Advance the block by step_size seconds with the inputs as they are."""
        try:
            if self._inputs is None:
                self._read()
            self._state = self._step(self._params, self._state, self._inputs, step_size)
            y = self._evaluate(self._params, self._state, self._inputs)
        except Exception:
            self._outlive_the_exception()
            raise
        self._values[self._outputs] = self._unpack(y)
        return True

    def get_real(self, vrs: list[int]) -> list[Any]:
        """Values of the given references."""
        if not vrs:
            return []
        if self._inputs is None:
            self._refresh()
        first = vrs[0]
        stop = first + len(vrs)
        if vrs == self._references[first:stop]:
            return self._values[first:stop]
        return [self._values[vr] for vr in vrs]

    get_boolean = get_real

    def set_real(self, vrs: list[int], values: list[Any]) -> None:
        """Set inputs or parameters; outputs follow when they are next asked for."""
        if not vrs:
            return
        first = vrs[0]
        stop = first + len(vrs)
        if vrs == self._references[first:stop]:
            self._values[first:stop] = values
        else:
            for vr, value in zip(vrs, values, strict=True):
                self._values[vr] = value
            stop = max(vrs) + 1
        if stop > self._first_parameter:
            self._params = None
        self._inputs = None

    set_boolean = set_real

    def _refresh(self) -> None:
        """Work out the outputs; before the end of initialisation the initial state as well."""
        try:
            self._read()
            if not self._initialised:
                self._state = self.block.initial_state(self._params, self._inputs)
            y = self._evaluate(self._params, self._state, self._inputs)
        except Exception:
            self._outlive_the_exception()
            raise
        self._values[self._outputs] = self._unpack(y)

    def _outlive_the_exception(self) -> None:
        """Keep the host alive.

        pythonfmu 0.7.0 gives up its references to class, instance and log when it reports an
        exception, but goes on using them, in fmi2Terminate and fmi2FreeInstance at the latest.
        """
        for used in (type(self), self, self.log_queue):
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(used))

    def _read(self) -> None:
        """Params and Inputs from the list of values."""
        if self._params is None:
            try:
                self._params = build_params(self.block, self._fields, self._values)
            except ValueError as error:
                raise ParameterError(str(error)) from error
        self._inputs = self._pack(self._values)
