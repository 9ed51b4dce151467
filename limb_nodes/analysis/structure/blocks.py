"""Equations that must be solved together, in the order in which they can be solved."""

from __future__ import annotations

from collections.abc import Sequence


def strong_components(edges: Sequence[Sequence[int]]) -> list[list[int]]:
    """Strongly connected components of a graph, each behind those that its edges lead to.

    So are the nodes of a component, as far as its cycles allow.
    R. Tarjan, SIAM J. Comput. 1 (1972) 146, without recursion.
    """
    number = [-1] * len(edges)
    lowest = [0] * len(edges)
    on_stack = [False] * len(edges)
    stack: list[int] = []
    components: list[list[int]] = []
    count = 0
    for root in range(len(edges)):
        if number[root] >= 0:
            continue
        path = [(root, 0)]
        while path:
            node, position = path.pop()
            if position == 0:
                number[node] = lowest[node] = count
                count += 1
                stack.append(node)
                on_stack[node] = True
            descended = False
            for place in range(position, len(edges[node])):
                other = edges[node][place]
                if number[other] < 0:
                    path += [(node, place + 1), (other, 0)]
                    descended = True
                    break
                if on_stack[other]:
                    lowest[node] = min(lowest[node], number[other])
            if descended:
                continue
            if lowest[node] == number[node]:
                component = []
                while True:
                    member = stack.pop()
                    on_stack[member] = False
                    component.append(member)
                    if member == node:
                        break
                components.append(component)
            if path:
                parent = path[-1][0]
                lowest[parent] = min(lowest[parent], lowest[node])
    return components
