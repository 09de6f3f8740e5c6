"""From a component to a running instance of its FMU."""

from ..base.errors import InputError
from ..interface.interface import Interface
from ..system.parts import Component, Solver
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
        return ProcessInstance(component.name, component.loaded, component.solver)
    if component.native and component.loaded.version == "2.0":
        return SharedInstance(component.name, component.loaded)
    return load_here(component.name, component.loaded, component.solver)


def load_here(name: str, interface: Interface, solver: Solver | None = None) -> LoadedInstance:
    """The instance of an FMU in this process; by model exchange with a solver, or if it has to."""
    if solver or "CoSimulation" not in interface.kinds:
        try:
            from .model_exchange import Fmi2Model, Fmi3Model  # loads the solver's libraries
        except OSError as error:
            raise InputError(
                f"{name}: {interface.path.name} is for model exchange, and FMPy has no CVode for "
                f"this machine: {error}; must be a co-simulation FMU"
            ) from error
        model = Fmi3Model if interface.version.startswith("3") else Fmi2Model
        return model(name, interface, solver or Solver())
    instance = Fmi3Instance if interface.version.startswith("3") else FmuInstance
    return instance(name, interface)
