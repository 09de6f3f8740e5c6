"""From a component to a running instance of its FMU."""

from ..interface.interface import Interface
from ..system.parts import Component
from .fmi2 import FmuInstance, SharedInstance
from .fmi3 import Fmi3Instance
from .instance import Instance
from .loaded import LoadedInstance
from .process import ProcessInstance


def load(component: Component) -> Instance:
    """The instance of a component, in a process of its own where it wants one.

    InputError where the FMU does not load. The caller closes it.
    """
    if component.isolation == "process":
        return ProcessInstance(component.name, component.loaded)
    if component.native and component.loaded.version == "2.0":
        return SharedInstance(component.name, component.loaded)
    return load_here(component.name, component.loaded)


def load_here(name: str, interface: Interface) -> LoadedInstance:
    """The instance of an FMU in this process."""
    instance = Fmi3Instance if interface.version.startswith("3") else FmuInstance
    return instance(name, interface)
