"""Groups: what is worked out, checked and shown of one kind of system, under the name it has.

A system file asks for them by name, `metrics = ["grasp"]`. How one of a user's own is made and
registered: docs/reference/metrics.md.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ..base.errors import InputError, nearest
from ..base.registry import here, register_here, registered
from .metric import Function, Metric, lacking, metric, names_of, reasons_against, resolved


def no_notes(system: Any) -> tuple[str, ...]:
    """What a group notes of a system where it checks none."""
    return ()


@dataclass(frozen=True)
class Group:
    """What is worked out of, checked and shown of one kind of system.

    `metrics` are in the order in which they are shown. `check` gets a system before it runs: it
    returns lines for the log, and raises InputError where it has something against its values.
    `view` imports and returns how a result is shown, a recording.result.View: a function, as
    pictures take long to import and few runs are drawn. Without one a result is shown as any is.
    """

    metrics: tuple[Metric, ...]
    check: Callable[[Any], Sequence[str]] = no_notes
    view: Callable[[], Any] | None = None


def register_group(name: str, group: Group) -> None:
    """Let system files ask for a group by that name, in this process and those of its sweeps.

    A group of an installed package needs no call: it is an entry point of `grasp_cosim.groups`.
    InputError for the name of a built-in group, or where it is no Group.
    """
    register_here("groups", name, _checked(name, group))


def script_groups(names: Iterable[str]) -> dict[str, Group]:
    """Those of these groups that only this process has, for another one that shows no result."""
    groups = here("groups")
    return {name: replace(groups[name], view=None) for name in names if name in groups}


def group_of(name: str) -> Group:
    """The group of that name; InputError where there is none, or it cannot be imported."""
    return _checked(name, registered("groups", name))


def _checked(name: str, group: Any) -> Group:
    if not isinstance(group, Group):
        raise InputError(
            f"groups: {name!r}: is of type {type(group).__name__}; must be a "
            "grasp_cosim.metrics.groups.Group"
        )
    return group


def metrics_of(names: Iterable[str], more: Iterable[Metric] = ()) -> tuple[Metric, ...]:
    """The metrics of groups, then `more`; InputError for no such group, or two of one name."""
    by_name: dict[str, Metric] = {}
    for name in names:
        by_name |= {m.name: m for m in group_of(name).metrics}
    for m in more:
        if m.name in by_name:
            raise InputError(f"metric {m.name!r}: is defined twice; must have another name")
        by_name[m.name] = m
    return tuple(by_name.values())


def check_groups(system: Any) -> list[str]:
    """What the groups that a System names note of its values, lines for the log.

    InputError where one has something against them.
    """
    return [note for name in system.metrics for note in group_of(name).check(system)]


def check_needs(users_metric: Metric, signals: Collection[str], roles: Mapping[str, str]) -> None:
    """InputError if a user's metric, unless it is optional, needs another signal than these."""
    if users_metric.group or users_metric.optional:
        return
    sized = users_metric.of(signals, roles)
    for need in sized.needs:
        if reason := lacking((need,), signals, roles, sized.needs):
            first = resolved(names_of(need)[0], roles)
            raise InputError(
                f"metric {users_metric.name!r}: {reason}; {nearest(first, sorted(signals))}"
            )


def chosen(
    requested: Iterable[Metric | Function | str],
    groups: Iterable[str],
    signals: Collection[str],
    roles: Mapping[str, str],
) -> tuple[Metric, ...]:
    """The requested metrics that are not in groups anyway: metrics, functions, names of metrics.

    A function is a metric with its name, without a unit; a name is one of those in the groups.
    InputError where there is none of that name, or `signals` of these names do not permit it. A
    group is for many systems, which may lack signals; a user's own metric names what it needs.
    """
    by_name = {m.name: m for m in metrics_of(groups)}
    reasons = reasons_against(by_name.values(), signals, roles)
    beside_groups: list[Metric] = []
    for item in requested:
        if isinstance(item, Metric):
            check_needs(item, signals, roles)
            beside_groups.append(item)
        elif callable(item):
            name = str(getattr(item, "__name__", type(item).__name__))
            beside_groups.append(metric(name)(item))
        elif not isinstance(item, str):
            raise InputError(f"metrics: {item!r}: must be a metric, a function or a name")
        elif item not in by_name:
            raise InputError(f"metrics: {item!r}: no such metric; {nearest(item, by_name)}")
        elif reason := reasons[item]:
            raise InputError(f"metrics: {item}: is not available: {reason}")
    return tuple(beside_groups)
