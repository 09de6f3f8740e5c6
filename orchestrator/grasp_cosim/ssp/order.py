"""The order of execution of an archive that names none: along the flow of the data."""

from collections.abc import Iterable, Sequence


def flow_order(names: Sequence[str], connections: Iterable[tuple[str, str]]) -> tuple[str, ...]:
    """The names such that who gives goes before who takes; within a loop, and else, as given.

    connections lead from name to name. The elements of an SSD are in no order of execution, often
    sorted by name, and a sequential scheme against the flow delays a value by a step. Inside a loop
    no order is better than that of the file.
    """
    behind: dict[str, set[str]] = {name: set() for name in names}
    for source, target in connections:
        behind[source].add(target)
    for between in names:  # the transitive closure, after Warshall
        for reached in behind.values():
            if between in reached:
                reached |= behind[between]
    order: list[str] = []
    left = list(names)
    while left:
        waiting = {n for n in left for o in left if n in behind[o] and o not in behind[n]}
        order.append(next(name for name in left if name not in waiting))
        left.remove(order[-1])
    return tuple(order)
