"""The order of execution of an archive that names none: along the flow of the data."""

from collections.abc import Iterable, Sequence

from ..system.parts import Component, Connection


def flow_order(
    components: Sequence[Component], connections: Iterable[Connection]
) -> tuple[Component, ...]:
    """The components such that who gives goes before who takes; within a loop, and else, as given.

    The elements of an SSD are in no order of execution, often sorted by name, and a sequential
    scheme against the flow delays a value by a step. Inside a loop no order is better than that of
    the file.
    """
    behind: dict[str, set[str]] = {component.name: set() for component in components}
    for connection in connections:
        behind[connection.source.component].add(connection.target.component)
    for between in behind:  # the transitive closure, after Warshall
        for reached in behind.values():
            if between in reached:
                reached |= behind[between]
    left = {component.name: component for component in components}
    order: list[Component] = []
    while left:
        waiting = {n for n in left for o in left if n in behind[o] and o not in behind[n]}
        order.append(left.pop(next(name for name in left if name not in waiting)))
    return tuple(order)
