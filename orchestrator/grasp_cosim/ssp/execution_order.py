"""The order of execution of an archive that names none: along the flow of the data."""

from collections import Counter
from collections.abc import Iterable, Sequence
from heapq import heapify, heappop, heappush

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..system.parts import Component, Connection


def flow_order(
    components: Sequence[Component], connections: Iterable[Connection]
) -> tuple[Component, ...]:
    """The components such that who gives goes before who takes; within a loop, and else, as given.

    The elements of an SSD are in no order of execution, often sorted by name, and a sequential
    scheme against the flow delays a value by a step. Inside a loop no order is better than that of
    the file.
    """
    places = {component.name: i for i, component in enumerate(components)}
    edges = {(places[c.source.component], places[c.target.component]) for c in connections}
    start, end = np.array([*edges], int).reshape(-1, 2).T
    flow = coo_array((np.ones(len(edges)), (start, end)), (len(places), len(places)))
    _, loop_of = connected_components(flow, connection="strong")
    loops: dict[int, list[int]] = {}
    for i, loop in enumerate(loop_of.tolist()):
        loops.setdefault(loop, []).append(i)
    between = {(loop_of[s], loop_of[t]) for s, t in edges if loop_of[s] != loop_of[t]}
    gives: dict[int, list[int]] = {loop: [] for loop in loops}
    for source, target in between:
        gives[source].append(target)
    waits = Counter(target for _, target in between)
    left = Counter(loop_of.tolist())
    free = [i for i, loop in enumerate(loop_of) if not waits[loop]]
    heapify(free)
    order = []
    while free:
        order.append(components[place := heappop(free)])
        loop = loop_of[place]
        left[loop] -= 1
        for after in gives[loop] if not left[loop] else ():
            waits[after] -= 1
            for i in loops[after] if not waits[after] else ():
                heappush(free, i)
    return tuple(order)
