"""The steps that co-simulation FMUs declare, against those that are asked of them.

FMI has three declarations. fixedInternalStepSize (FMI 3.0) is the length of the FMU's own steps: it
gets to a communication point only where the step that is asked is a whole number of these.
canHandleVariableCommunicationStepSize = false says that all steps have to be equally long, but not
how long. stepSize of the default experiment recommends a length; of an FMU that cannot vary its
step it may be the only one: some take it whatever they are asked, and nothing shows it. Where it
can vary them, a step is worth a word that is no whole number of those. Only our FMUs divide
any step by themselves.
"""

from collections.abc import Iterator

from ..base.errors import InputError
from .parts import Component
from .structure import Structure
from .times import LONGEST, Time, common, multiple, step_of, written


def check_declared_steps(system: Structure) -> None:
    """InputError at the first FMU that declares that it cannot take the step asked of it."""
    for component in system.components:
        inner = _inner_step(component)
        if inner is None or component.loaded.can_vary_step:
            continue
        if system.step_of(component) % inner:
            raise InputError(f"{system.name}: {_no_whole_number(system, component, inner)}")


def of_declared_steps(system: Structure) -> Iterator[str]:
    """Remarks on FMUs that may not take the step asked of them."""
    for component in system.components:
        inner, step = _inner_step(component), system.step_of(component)
        if inner is not None:
            if step % inner:
                yield _no_whole_number(system, component, inner)
            continue
        recommended = _time(component.loaded.step)
        if component.integrated or recommended is None:
            continue
        if component.loaded.can_vary_step:
            if step % recommended and not component.loaded.ours:
                yield (
                    f"{component.name}: {component.fmu.name} recommends steps of "
                    f"{written(recommended)} s, and is asked for {written(step)} s, which is no "
                    "whole number of them; one would be: "
                    f"{_overrides(system, component, _nearest_multiple(step, recommended))}"
                )
        elif step != recommended:
            yield (
                f"{component.name}: {component.fmu.name} recommends steps of "
                f"{written(recommended)} s, and declares that it cannot vary them "
                f"(canHandleVariableCommunicationStepSize = false); it is asked for "
                f"{written(step)} s: if it takes its own all the same, its time is wrong, and "
                f"nothing shows it; with its own: {_overrides(system, component, recommended)}"
            )


def _inner_step(component: Component) -> Time | None:
    """The length of the steps that the FMU of a component takes inside, where it tells that."""
    if component.integrated:
        return None
    return _time(component.loaded.capability("fixedInternalStepSize"))


def _time(declared: object) -> Time | None:
    """A step that is declared in s; None where it is none."""
    return step_of(declared) if isinstance(declared, float) and 0.0 < declared <= LONGEST else None


def _nearest_multiple(step: Time, inner: Time) -> Time:
    """The whole number of inner steps that is nearest to a step, at least one."""
    return max(1, round(step / inner)) * inner


def _no_whole_number(system: Structure, component: Component, inner: Time) -> str:
    """That the step of a component is no whole number of its inner steps, and what would be."""
    step = system.step_of(component)
    fitting = _nearest_multiple(step, inner)
    return (
        f"{component.name}: {component.fmu.name} takes steps of {written(inner)} s inside "
        f"(fixedInternalStepSize), and {written(step)} s is no whole number of them; "
        f"one would be: {_overrides(system, component, fitting)}"
    )


def _overrides(system: Structure, component: Component, step: Time) -> str:
    """The overrides with which a component has a step, and the system still fits together."""
    other_steps = [
        c.step_ns for c in system.components if c.step_ns is not None and c is not component
    ]
    overrides: dict[str, Time] = {}
    base = system.step_ns
    if step % base:
        base = common(step, *other_steps)
        overrides["experiment.step"] = base
    if step != base or component.step_ns is not None:
        overrides[f"components.{component.name}.step"] = step
    span, unit = system.stop_ns - system.start_ns, multiple(step, *other_steps)
    if span % unit:
        overrides["experiment.stop"] = system.start_ns + max(1, round(span / unit)) * unit
    return " ".join(f"--set {place}={written(time)}" for place, time in overrides.items())
