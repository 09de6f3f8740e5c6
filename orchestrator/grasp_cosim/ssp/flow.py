"""The order of execution along the flow of the data, in a time that grows with the system."""

from collections.abc import Iterable, Sequence
from heapq import heapify, heappop, heappush

from ..system.parts import Component, Connection

Graph = Sequence[Sequence[int]]
"""For each node, by number, the nodes that an edge leads to."""


def flow_order(
    components: Sequence[Component], connections: Iterable[Connection]
) -> tuple[Component, ...]:
    """The components such that who gives goes before who takes; within a loop, and else, as given.

    The elements of an SSD are in no order of execution, and often sorted by name. A sequential
    scheme against the flow delays a value by a step. Inside a loop no order is better than that of
    the file.
    """
    places = {component.name: i for i, component in enumerate(components)}
    takers: list[list[int]] = [[] for _ in components]
    givers: list[list[int]] = [[] for _ in components]
    for c in connections:
        source, target = places[c.source.component], places[c.target.component]
        takers[source].append(target)
        givers[target].append(source)
    loop_of = loops(takers, givers)
    members: list[list[int]] = [[] for _ in components]
    for node, loop in enumerate(loop_of):
        members[loop].append(node)
    behind: list[set[int]] = [set() for _ in components]
    for source, targets in enumerate(takers):
        behind[loop_of[source]].update(loop_of[target] for target in targets)
    waits = [0] * len(components)
    for loop, later_loops in enumerate(behind):
        later_loops.discard(loop)
        for later in later_loops:
            waits[later] += 1
    ready = [node for node, loop in enumerate(loop_of) if not waits[loop]]
    heapify(ready)
    unplaced = [len(nodes) for nodes in members]
    order: list[Component] = []
    while ready:
        node = heappop(ready)  # the first in the file
        order.append(components[node])
        loop = loop_of[node]
        unplaced[loop] -= 1
        if unplaced[loop]:
            continue
        for later in behind[loop]:
            waits[later] -= 1
            if not waits[later]:
                for member in members[later]:
                    heappush(ready, member)
    return tuple(order)


def loops(forward: Graph, backward: Graph) -> list[int]:
    """The loop that each node is in, by the number of one of its nodes.

    Nodes that reach one another are in one loop, every other node is on its own. backward has the
    edges of forward the other way round. By Kosaraju's algorithm, linear in nodes and edges.
    """
    loop_of = [0] * len(forward)
    placed: set[int] = set()
    for node in reversed(finished(forward, range(len(forward)), set())):
        for member in finished(backward, [node], placed):
            loop_of[member] = node
    return loop_of


def finished(graph: Graph, starts: Iterable[int], visited: set[int]) -> list[int]:
    """The nodes that are reached from the starts, in the order in which a search leaves them.

    The search is depth first, and does not enter nodes that were visited; it adds to these.
    """
    order: list[int] = []
    for start in starts:
        path = [] if start in visited else [start]
        edges = [iter(graph[node]) for node in path]
        visited.update(path)
        while path:
            following = next((node for node in edges[-1] if node not in visited), None)
            if following is None:
                order.append(path.pop())
                edges.pop()
            else:
                visited.add(following)
                path.append(following)
                edges.append(iter(graph[following]))
    return order
