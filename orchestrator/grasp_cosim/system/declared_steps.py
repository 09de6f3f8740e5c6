"""The steps that co-simulation FMUs declare, against those that are asked of them.

FMI has three declarations. fixedInternalStepSize (FMI 3.0) is the length of the FMU's own steps: it
gets to a communication point only where the step that is asked is a whole number of these.
canHandleVariableCommunicationStepSize = false says that all steps have to be equally long, but not
how long. stepSize of the default experiment recommends a length; of an FMU that cannot vary its
step it may be the only one: some take it whatever they are asked, and nothing shows it.
"""

from collections.abc import Iterator

from ..base.errors import InputError
from .parts import Component
from .structure import Structure
from .times import LONGEST, Time, common, multiple, step_of, written


def check_declared_steps(system: Structure) -> None:
    """InputError at the first FMU that declares that it cannot take the step asked of it."""
    for component in system.components:
        own = _own_step(component)
        if (
            own is not None
            and not component.loaded.can_vary_step
            and asked(system, component) % own
        ):
            raise InputError(f"{system.name}: {_no_whole_number(system, component, own)}")


def of_declared_steps(system: Structure) -> Iterator[str]:
    """Remarks on FMUs that may not take the step asked of them."""
    for component in system.components:
        own, step = _own_step(component), asked(system, component)
        if own is not None:
            if step % own:
                yield _no_whole_number(system, component, own)
            continue
        recommended = _time(component.loaded.step)
        if component.integrated or component.loaded.can_vary_step or recommended is None:
            continue
        if step != recommended:
            yield (
                f"{component.name}: {component.fmu.name} recommends steps of "
                f"{written(recommended)} s, and declares that it cannot vary them "
                f"(canHandleVariableCommunicationStepSize = false); it is asked for "
                f"{written(step)} s: if it takes its own all the same, its time is wrong, and "
                f"nothing shows it; with its own: {_settings(system, component, recommended)}"
            )


def asked(system: Structure, component: Component) -> Time:
    """The communication step of a component."""
    return component.step_ns or system.step_ns


def _own_step(component: Component) -> Time | None:
    """The length of the steps that the FMU of a component takes inside, where it tells that."""
    if component.integrated:
        return None
    return _time(component.loaded.capability("fixedInternalStepSize"))


def _time(declared: object) -> Time | None:
    """A step that is declared in s; None where it is none."""
    return step_of(declared) if isinstance(declared, float) and 0.0 < declared <= LONGEST else None


def _no_whole_number(system: Structure, component: Component, own: Time) -> str:
    """That the step of a component is no whole number of its own steps, and what would be."""
    step = asked(system, component)
    whole = max(1, round(step / own)) * own
    return (
        f"{component.name}: {component.fmu.name} takes steps of {written(own)} s inside "
        f"(fixedInternalStepSize), and {written(step)} s is no whole number of them; "
        f"one would be: {_settings(system, component, whole)}"
    )


def _settings(system: Structure, component: Component, step: Time) -> str:
    """The settings with which a component has a step, and the system still fits together."""
    others = [c.step_ns for c in system.components if c.step_ns is not None and c is not component]
    settings = {}
    base = system.step_ns
    if step % base:
        base = common(step, *others)
        settings["experiment.step"] = base
    if step != base or component.step_ns is not None:
        settings[f"components.{component.name}.step"] = step
    span, whole = system.stop_ns - system.start_ns, multiple(step, *others)
    if span % whole:
        settings["experiment.stop"] = system.start_ns + max(1, round(span / whole)) * whole
    return " ".join(f"--set {place}={written(time)}" for place, time in settings.items())
