"""Connectivity of triangle meshes: edges, components, winding, boundary loops, welding of vertices."""

from __future__ import annotations

import numpy as np

from ..arrays import Array, BoolArray, IntArray


def directed_edges(faces: IntArray) -> IntArray:
    """The ``(3F, 2)`` directed edges; edge ``f + k F`` runs from corner k of face f to the next corner."""
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])


def _keys(edges: IntArray, count: int) -> IntArray:
    return edges[:, 0] * count + edges[:, 1]


def is_closed(faces: IntArray) -> bool:
    """Whether every directed edge is matched by one in the opposite direction: the surface has no boundary.

    This is what the mass integrals need. It holds too where four faces meet in one edge, as two touching parts do.
    """
    if not len(faces):
        return False
    edges = directed_edges(faces)
    count = int(faces.max()) + 1
    return bool(np.array_equal(np.sort(_keys(edges, count)), np.sort(_keys(edges[:, ::-1], count))))


def boundary_edges(faces: IntArray) -> IntArray:
    """Directed edges ``(E, 2)`` of *faces* that lack a partner in the opposite direction, with multiplicity."""
    count = int(faces.max()) + 1
    edges = directed_edges(faces)
    keys, number = np.unique(_keys(edges, count), return_counts=True)
    reverse = (keys % count) * count + keys // count
    at = np.searchsorted(keys, reverse)
    at = np.minimum(at, len(keys) - 1)
    partners = np.where(keys[at] == reverse, number[at], 0)
    surplus = np.maximum(number - partners, 0)
    lone = np.repeat(keys, surplus)
    return np.stack([lone // count, lone % count], axis=1)


def boundary_loops(faces: IntArray) -> list[list[int]]:
    """Closed loops of boundary vertices, in the order in which a cap over the hole must run.

    A hole is walked along its boundary edges reversed; loops that touch at a vertex are split there.
    """
    following: dict[int, list[int]] = {}
    for a, b in boundary_edges(faces):
        following.setdefault(int(b), []).append(int(a))
    loops: list[list[int]] = []
    while following:
        start = next(iter(following))
        path, seen = [start], {start: 0}
        while path and path[-1] in following:
            here = path[-1]
            nexts = following[here]
            ahead = nexts.pop()
            if not nexts:
                del following[here]
            if ahead in seen:
                first = seen[ahead]
                loops.append(path[first:])
                for vertex in path[first + 1 :]:
                    del seen[vertex]
                path = path[: first + 1]
            else:
                seen[ahead] = len(path)
                path.append(ahead)
    return loops


def adjacency(faces: IntArray) -> tuple[IntArray, IntArray, BoolArray]:
    """Pairs of faces that share an edge which belongs to exactly two faces.

    Returns the two face indices and whether the two are wound alike (they run along the edge in opposite directions).
    """
    edges = directed_edges(faces)
    forward = edges[:, 0] < edges[:, 1]
    low, high = edges.min(axis=1), edges.max(axis=1)
    order = np.lexsort((high, low))
    same = (low[order][1:] == low[order][:-1]) & (high[order][1:] == high[order][:-1])
    starts = np.flatnonzero(np.concatenate([[True], ~same]))
    sizes = np.diff(np.append(starts, len(order)))
    pairs = starts[sizes == 2]
    one, two = order[pairs], order[pairs + 1]
    return one % len(faces), two % len(faces), forward[one] != forward[two]


def components(faces: IntArray) -> IntArray:
    """A label ``(F,)`` per face: faces that are connected across edges of exactly two faces have the same one."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    one, two, _ = adjacency(faces)
    n = len(faces)
    graph = coo_array((np.ones(len(one), dtype=np.int8), (one, two)), shape=(n, n))
    _, labels = connected_components(graph, directed=False)
    return np.asarray(labels, dtype=np.int64)


def wind_alike(faces: IntArray) -> tuple[IntArray, int]:
    """*faces* turned so that neighbours run alike, and how many had to be turned (per part, the minority is)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import breadth_first_order, connected_components

    one, two, alike = adjacency(faces)
    if alike.all():
        return faces, 0
    n = len(faces)
    # 1: alike, 2: turned (a stored zero would be dropped)
    weight = np.where(alike, 1, 2)
    graph = coo_array((np.r_[weight, weight], (np.r_[one, two], np.r_[two, one])), shape=(n, n)).tocsr()
    parts, labels = connected_components(graph, directed=False)
    turned = np.zeros(n, dtype=bool)
    relation = dict(zip(zip(one.tolist(), two.tolist()), (~alike).tolist()))
    for part in range(parts):
        seed = int(np.argmax(labels == part))
        order, before = breadth_first_order(graph, seed, directed=False)
        for face in order[1:].tolist():
            parent = int(before[face])
            flip = relation[(parent, face)] if (parent, face) in relation else relation[(face, parent)]
            turned[face] = turned[parent] ^ flip
        if 2 * turned[order].sum() > len(order):
            turned[order] = ~turned[order]
    result = faces.copy()
    result[turned] = result[turned][:, ::-1]
    return result, int(turned.sum())


def weld(vertices: Array, faces: IntArray, distance: float) -> tuple[Array, IntArray]:
    """Vertices nearer than *distance* (0: identical ones) become one; unused ones go; collapsed faces go."""
    if distance > 0.0:
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components
        from scipy.spatial import cKDTree

        pairs = cKDTree(vertices).query_pairs(distance, output_type="ndarray")
        n = len(vertices)
        graph = coo_array((np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
        _, label = connected_components(graph, directed=False)
        _, first = np.unique(label, return_index=True)
        vertices, faces = vertices[first], label[faces].astype(np.int64)
    else:
        _, first, inverse = np.unique(vertices, axis=0, return_index=True, return_inverse=True)
        rank = np.empty(len(first), dtype=np.int64)
        order = np.argsort(first)  # keep the order of the file
        rank[order] = np.arange(len(first))
        vertices, faces = vertices[first[order]], rank[inverse.reshape(-1)][faces]
    proper = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return compact(vertices, faces[proper])


def without_flaps(faces: IntArray) -> IntArray:
    """*faces* without pairs of the same three vertices in opposite order: the two cancel and enclose nothing."""
    key, inverse = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True)
    if len(key) == len(faces):
        return faces
    inverse = inverse.reshape(-1)
    turn = np.argmin(faces, axis=1)[:, None] + np.arange(3)
    rolled = np.take_along_axis(faces, turn % 3, axis=1)
    even = rolled[:, 1] < rolled[:, 2]
    pairs = np.minimum(np.bincount(inverse, even, len(key)), np.bincount(inverse, ~even, len(key)))
    keep = np.ones(len(faces), dtype=bool)
    for sign in (even, ~even):
        left = pairs.copy()
        for face in np.flatnonzero(sign & (pairs[inverse] > 0)):
            if left[inverse[face]] > 0:
                left[inverse[face]] -= 1
                keep[face] = False
    return faces[keep]


def compact(vertices: Array, faces: IntArray) -> tuple[Array, IntArray]:
    """The same mesh without vertices that no face uses."""
    used, inverse = np.unique(faces, return_inverse=True)
    return np.ascontiguousarray(vertices[used]), np.ascontiguousarray(inverse.reshape(faces.shape), dtype=np.int64)
