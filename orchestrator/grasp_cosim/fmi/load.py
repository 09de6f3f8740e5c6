"""Which instance a component has: of an FMU in this process or in one of its own, or of code."""

from pathlib import Path

from ..base.errors import InputError
from ..interface.interface import Interface
from ..system.parts import Component, Logging, Solver
from .co_simulation import Fmi3Instance, FmuInstance, SharedInstance
from .instance import Instance


def is_reset_exactly(component: Component) -> bool:
    """True for a native twin here, which after a reset is as it was when it was loaded."""
    return (
        component.native is not None
        and component.loaded.version == "2.0"
        and component.isolation == "none"
        and not (component.trace or component.logging)
    )


def load(component: Component) -> Instance:
    """The instance of a component, in its own process where it wants one.

    InputError where the FMU does not load. The caller closes it.
    """
    name, interface = component.name, component.loaded
    if component.code:
        from .python_code import CodeInstance  # only here, as below: few components need it

        return CodeInstance(name, component.code)
    if component.isolation == "process":
        from .process import ProcessInstance

        solver, logging = component.solver, component.logging
        return ProcessInstance(name, interface, solver, logging, component.trace)
    if component.native and interface.version == "2.0":
        return SharedInstance(name, interface, logging=component.logging, trace=component.trace)
    return load_here(name, interface, component.solver, component.logging, component.trace)


def load_here(
    name: str,
    interface: Interface,
    solver: Solver | None = None,
    logging: Logging = False,
    trace: Path | None = None,
) -> Instance:
    """The instance of an FMU in this process.

    By model exchange where it has to be, or where there is a `solver` and the FMU is for that, too.
    The solver of a co-simulation FMU gets the relative tolerance of this one, or else that of the
    FMU's default experiment.
    """
    three = interface.version.startswith("3")
    exchanged = "CoSimulation" not in interface.kinds or (solver and interface.exchange)
    if not exchanged:
        tolerance = solver.relative_tolerance if solver else interface.tolerance
        if interface.event_mode:
            from .event_mode import EventInstance  # only here: few FMUs have it

            return EventInstance(name, interface, tolerance, logging, trace)
        kind = Fmi3Instance if three else FmuInstance
        return kind(name, interface, tolerance, logging, trace)
    try:
        from .model_exchange import Fmi2Model, Fmi3Model  # loads the solver's libraries
    except OSError as error:
        raise InputError(
            f"{name}: {interface.file_name} is for model exchange, and FMPy has no CVode for "
            f"this machine: {error}; must be a co-simulation FMU"
        ) from error
    model = Fmi3Model if three else Fmi2Model
    return model(name, interface, solver or Solver(), logging, trace)
