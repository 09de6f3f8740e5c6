"""Friction from contact times: grasps with the sensors ideal, as the fit has them.

The grasps run through the FMUs at STEP. With the sensors' electronics off, a contact time at STEP
is within 2 ms of that at 0.1 ms. This is a hundredth of the scatter of the published times; the
reflectances matter by their ratio only, so that surfaces of equal colours are one grasp.
"""

import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...base.errors import InputError, SimulationError, choices
from ...base.parallel import Crew
from ...base.progress import Progress
from ...system.description import System
from ...tables.read_table import names_in
from ..metrics import FINGERS
from ..presets import CASES, start_in_si, with_case, with_si_values
from ..published.published_figures import Setting, published_figures
from ..published.reproduction import run_grasp
from .fit import Fit, Parameter, Vector, fit
from .measured_table import read_rows

STEP, STOP = 1e-3, 10.0
"""s; a finger that has not touched at STOP counts as touching then."""

RATIO = "sensor_2.reflectance"
"""One number for the bench: what the left sensor sees of a surface over what the right one does."""

COLUMNS = ("x_m", "case", "finger", "time")
OPTIONAL_COLUMNS = ("alpha_1", "alpha_2")
"""The columns of a table of contact times."""

UNITS = {"x_m": "m", "case": "1", "finger": "1", "time": "s", "alpha_1": "1", "alpha_2": "1"}
"""The units of these columns, where the table names none."""

Times = Sequence[float]


class Grasp(NamedTuple):
    """A grasp of a fit: x_m in m, alpha_2 over alpha_1, case, and the parameters by name."""

    x_m: float
    ratio: float
    case: int
    parameters: tuple[tuple[str, float], ...]


Simulator = Callable[[Sequence[Grasp]], Iterable[Times]]
"""The contact times of grasps in s, in their order."""


class Contact(NamedTuple):
    """A measured contact time in s; label says which row of the data it is."""

    label: str
    setting: Setting
    case: int
    finger: int
    time: float


def published_contacts() -> list[Contact]:
    """The experimental position rows and those of two equal colours.

    White on both sides is the row of x_m = 0.03 m once more, so it is left out.
    """
    contacts = []
    for figure in published_figures("experiment"):
        condition, finger = figure.condition, figure.finger
        if finger and figure.setting.equal_colours and condition != "white/white":
            label = f"x_m = {condition} m" if figure.table == "position" else str(condition)
            contacts.append(Contact(label, figure.setting, figure.case, finger, figure.published))
    return contacts


def is_contacts(path: Path) -> bool:
    """True for a table of contact times, known by its columns; False for any other file."""
    return {*COLUMNS[1:3]} <= {*names_in(path)}


def read_contacts(path: Path) -> list[Contact]:
    """A table of contact times: the columns x_m, case, finger, time, and, where the surfaces are
    not alike, alpha_1 and alpha_2; in m and s, or in the units behind their names.

    A warning names other columns, which are not used. InputError names the line that is wrong.
    """
    rows = read_rows(path, UNITS, "contact times", OPTIONAL_COLUMNS)
    return [_contact(row.place, row.numbers) for row in rows]


def identify_from_times(
    system: System,
    contacts: Sequence[Contact],
    parameters: Sequence[Parameter],
    progress: bool,
    cross_validation: bool = False,
) -> Fit:
    """Fit the parameters to contact times, grasps in parallel; the residuals are in s.

    With cross_validation the fit is repeated without each row. progress counts the grasps on
    standard error.
    """
    system = system.with_experiment(STEP, STOP)
    workers = os.cpu_count() or 1
    with Progress("identify", unit="grasp", shown=progress) as bar, Crew(workers) as crew:

        def simulate(grasps: Sequence[Grasp]) -> Iterable[Times]:
            return crew.map(contact_times, [(system, grasp) for grasp in grasps], bar)

        simulate_once = _remembering(simulate)
        found = fit_contacts(contacts, parameters, simulate_once)
        if not cross_validation:
            return found
        return replace(found, left_out=leave_rows_out(contacts, parameters, found, simulate_once))


def _remembering(simulate: Simulator) -> Simulator:
    """A simulator that runs equal grasps once."""
    simulated: dict[Grasp, Times] = {}

    def simulate_once(grasps: Sequence[Grasp]) -> list[Times]:
        new = list(dict.fromkeys(grasp for grasp in grasps if grasp not in simulated))
        simulated.update(zip(new, simulate(new), strict=True))
        return [simulated[grasp] for grasp in grasps]

    return simulate_once


def fit_contacts(
    contacts: Sequence[Contact],
    parameters: Sequence[Parameter],
    simulate: Simulator,
    place: str = "identify",
) -> Fit:
    """Fit the parameters to contact times with what simulates grasps; equal grasps run once."""
    simulate_once = _remembering(simulate)

    def residuals(points: Sequence[Vector]) -> list[Vector]:
        return _residuals(contacts, parameters, points, simulate_once)

    return fit(residuals, parameters, place)


def leave_rows_out(
    contacts: Sequence[Contact], parameters: Sequence[Parameter], found: Fit, simulate: Simulator
) -> Vector:
    """The residual of each contact, in s, in a fit to the contacts of all other settings.

    Each fit begins at the parameters that were found with all contacts.
    """
    begin = [p._replace(start=e.value) for p, e in zip(parameters, found.estimates, strict=True)]
    left_out = np.empty(len(contacts))
    for setting in dict.fromkeys(c.setting for c in contacts):
        others = [c for c in contacts if c.setting != setting]
        without = fit_contacts(others, begin, simulate, f"identify without {setting.label}")
        values = np.array([e.value for e in without.estimates])
        rows = [row for row, c in enumerate(contacts) if c.setting == setting]
        of_setting = [contacts[row] for row in rows]
        left_out[rows] = _residuals(of_setting, parameters, [values], simulate)[0]
    return left_out


def _residuals(
    contacts: Sequence[Contact],
    parameters: Sequence[Parameter],
    points: Sequence[Vector],
    simulate: Simulator,
) -> list[Vector]:
    """Simulated less measured times in s at several values of the parameters."""
    measured = np.array([c.time for c in contacts])
    grasps = [_grasp(c, parameters, x) for x in points for c in contacts]
    times = list(simulate(grasps))
    count = len(contacts)
    of_points = [times[first : first + count] for first in range(0, len(times), count)]
    return [_times_of(contacts, of_point) - measured for of_point in of_points]


def _times_of(contacts: Sequence[Contact], times: Sequence[Times]) -> Vector:
    """The simulated time in s of each contact, from the times of all fingers in its grasp."""
    return np.array([of_grasp[c.finger - 1] for c, of_grasp in zip(contacts, times, strict=True)])


def scatter(contacts: Sequence[Contact]) -> float | None:
    """The standard deviation in s of times that were measured in equal grasps, pooled.

    It is the pure error of an analysis of the lack of fit: what no model can explain. None where no
    grasp was repeated.
    """
    equal: dict[tuple[Grasp, int], list[float]] = {}
    for c in contacts:
        equal.setdefault((_grasp(c, (), np.empty(0)), c.finger), []).append(c.time)
    degrees_of_freedom = sum(len(times) - 1 for times in equal.values())
    squares = [np.sum((np.array(times) - np.mean(times)) ** 2) for times in equal.values()]
    return math.sqrt(math.fsum(squares) / degrees_of_freedom) if degrees_of_freedom else None


def _grasp(c: Contact, parameters: Sequence[Parameter], x: Vector) -> Grasp:
    values = tuple((p.name, float(value)) for p, value in zip(parameters, x, strict=True))
    return Grasp(c.setting.x_m, c.setting.alpha_2 / c.setting.alpha_1, c.case, values)


def contact_times(job: tuple[System, Grasp]) -> Times:
    """When the fingers touch in a grasp with a system, in s; at STOP where one does not."""
    system, grasp = job
    values = dict(grasp.parameters)
    ratio_of_sensors = values.get(RATIO, start_in_si(system, RATIO))
    values["plant.initial_object_position"] = grasp.x_m
    values[RATIO] = ratio_of_sensors * grasp.ratio
    try:
        system = with_si_values(with_case(system, grasp.case), values, "identify:")
        times: Any = run_grasp(system, hold_time=0.0).metrics["time_to_contact"]
    except (InputError, SimulationError) as error:
        error.args = (f"x_m = {grasp.x_m:g} m, Case {grasp.case}: {error}",)
        raise
    return [STOP if t is None else float(t) for t in times]


def _contact(place: str, numbers: Mapping[str, float]) -> Contact:
    """The contact of a row; InputError where there can be none such."""
    for name, valid in (("case", CASES), ("finger", FINGERS)):
        if numbers[name] not in valid:
            raise InputError(
                f"{place}: {name} = {numbers[name]:g}: must be one of {choices(valid)}"
            )
    x_m, time = numbers["x_m"], numbers["time"]
    alphas = [numbers.get(name, 1.0) for name in OPTIONAL_COLUMNS]
    if not (0.0 < time < STOP and min(alphas) > 0.0 and np.isfinite([x_m, *alphas]).all()):
        raise InputError(
            f"{place}: x_m = {x_m:g} m, time = {time:g} s, alpha = {choices(alphas)}: must be "
            f"finite, the time greater than 0 and less than {STOP:g}, alpha greater than 0"
        )
    setting = Setting(x_m, *alphas)
    return Contact(f"x_m = {x_m:g} m", setting, int(numbers["case"]), int(numbers["finger"]), time)
