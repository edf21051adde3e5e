"""Say in words why a mesh is no solid: where, how many, what to do."""

from collections import defaultdict

import numpy as np
from numpy.typing import NDArray

from planner.arrays import FloatArray
from planner.geometry.topology import CROWDED, OPEN, Topology, consistent_winding

__all__ = ["describe_faults"]


def describe_faults(vertices: FloatArray, topology: Topology) -> str:
    """Describe the fault that matters most of a mesh that is not closed.

    Parameters
    ----------
    vertices, topology
        A welded mesh.
    """
    if len(topology.faces) == 0:
        return "every triangle has two equal corners; export the part again"
    if (np.ptp(vertices, axis=0) == 0.0).any():
        return "it is flat and encloses no volume; export it with a thickness in every direction"
    opened, crowded = topology.edges(OPEN), topology.edges(CROWDED)
    if len(opened) == 3 * len(topology.faces):
        return (
            f"its {len(topology.faces)} triangles share no edge: they are a soup, not a surface; "
            "export the part as a solid"
        )
    if len(opened):
        return _describe_borders(vertices, opened, len(crowded))
    if len(crowded):
        pairs, count = np.unique(np.sort(crowded, axis=1), axis=0, return_counts=True)
        length = np.linalg.norm(vertices[pairs[:, 1]] - vertices[pairs[:, 0]], axis=1).sum()
        return (
            f"{_edges(len(pairs))} in all {length:.4g} mm long with up to {count.max()} faces, "
            f"the first at {_middle(vertices, crowded[0])}: bodies or walls touch along a line, "
            "which has no thickness to print; let them overlap, or move them apart"
        )
    if consistent_winding(topology) is None:
        return "the surface has one side only, as a Möbius strip; export the part as a solid"
    return f"{_edges(topology.same_way)} whose faces disagree on where outside is"


def _describe_borders(vertices: FloatArray, edges: NDArray[np.int32], crowded: int) -> str:
    loops = _loops(edges)
    length = np.linalg.norm(vertices[edges[:, 1]] - vertices[edges[:, 0]], axis=1)
    around = [float(length[loop].sum()) for loop in loops]
    longest = int(np.argmax(around))
    points = vertices[np.unique(edges[loops[longest]])]
    x, y, z = (points.min(axis=0) + points.max(axis=0)) / 2
    holes = "1 hole" if len(loops) == 1 else f"{len(loops)} holes, the longest"
    also = f"; {crowded} more edges have over two faces" if crowded else ""
    return (
        f"the surface is open: {_edges(len(edges))} with one face around {holes} of "
        f"{around[longest]:.4g} mm around ({x:.4g}, {y:.4g}, {z:.4g}) mm{also}; close it in the "
        "CAD program, or export the part as a solid"
    )


def _loops(edges: NDArray[np.int32]) -> list[list[int]]:
    """Group border edges that hang together, by first appearance."""
    at = defaultdict(list)
    for number, (a, b) in enumerate(edges.tolist()):
        at[a].append(number)
        at[b].append(number)
    seen = [False] * len(edges)
    loops = []
    for seed in range(len(edges)):
        if seen[seed]:
            continue
        seen[seed] = True
        loop, stack = [], [seed]
        while stack:
            number = stack.pop()
            loop.append(number)
            for vertex in edges[number].tolist():
                for near in at.pop(vertex, ()):
                    if not seen[near]:
                        seen[near] = True
                        stack.append(near)
        loops.append(sorted(loop))
    return loops


def _edges(count: int) -> str:
    return "1 edge" if count == 1 else f"{count} edges"


def _middle(vertices: FloatArray, edge: NDArray[np.int32]) -> str:
    x, y, z = (vertices[edge[0]] + vertices[edge[1]]) / 2
    return f"({x:.4g}, {y:.4g}, {z:.4g}) mm"
