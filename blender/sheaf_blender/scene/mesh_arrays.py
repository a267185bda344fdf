# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Meshes as arrays: from Blender's corners to vertices that triangles share, by material."""
import dataclasses
import math

import numpy


@dataclasses.dataclass
class MeshArrays:
    """Vertices and triangles of one material. corners: for each vertex a corner of Blender's mesh
    that has its position, normal and uv, so that the mesh at another time has the same vertices.
    """
    positions: numpy.ndarray           # (n, 3) float32
    triangles: numpy.ndarray           # (m, 3) int32
    normals: numpy.ndarray | None      # (n, 3) float32
    uvs: numpy.ndarray | None          # (n, 2) float32
    corners: numpy.ndarray             # (n,) int32
    # Arrays that determine the above except for the last bits of the normals; None: they do not.
    source: list | None = None
    colors: numpy.ndarray | None = None  # (n, 4) float32, linear.


def weld(corner_vertices, normals=None, uvs=None, colors=None):
    """Corners that agree in vertex, normal, uv and color become one.

    Returns (corner of each new vertex, new vertex of each corner). Corners are compared by a hash
    of 64 bits, and then bit by bit: if a hash stands for two, no corner is joined.
    """
    columns = [numpy.ascontiguousarray(corner_vertices, numpy.int32).view(numpy.uint32)[:, None]]
    columns += [numpy.ascontiguousarray(values + numpy.float32(0)).view(numpy.uint32)
                for values in (normals, uvs, colors) if values is not None]
    hashes = numpy.zeros(len(corner_vertices), numpy.uint64)
    for column in columns:
        for i in range(column.shape[1]):
            hashes = (hashes ^ column[:, i]) * numpy.uint64(0x9E3779B97F4A7C15)
            hashes ^= hashes >> numpy.uint64(29)
    _, first, inverse = numpy.unique(hashes, return_index=True, return_inverse=True)
    inverse = inverse.reshape(-1)
    if all(numpy.array_equal(column[first[inverse]], column) for column in columns):
        return first.astype(numpy.int32), inverse.astype(numpy.int32)
    every = numpy.arange(len(corner_vertices), dtype=numpy.int32)
    return every, every


def build(positions, corner_vertices, triangles, normals=None, uvs=None, colors=None):
    """MeshArrays of all triangles. triangles: (m, 3) corners; normals, uvs, colors: of corners."""
    if normals is None and uvs is None and colors is None:
        # Positions alone: Blender's vertices, of which each is some corner.
        triangles = corner_vertices[triangles]
        used, triangles = _compact(triangles, len(positions))
        corner_of = numpy.zeros(len(positions), numpy.int32)
        corner_of[corner_vertices] = numpy.arange(len(corner_vertices), dtype=numpy.int32)
        return MeshArrays(positions[used], triangles, None, None, corner_of[used])
    used, triangles = _compact(triangles, len(corner_vertices))
    vertices = corner_vertices[used]
    normals = None if normals is None else normals[used]
    uvs = None if uvs is None else uvs[used]
    colors = None if colors is None else colors[used]
    first, inverse = weld(vertices, normals, uvs, colors)
    return MeshArrays(positions[vertices[first]], inverse[triangles],
                      None if normals is None else normals[first],
                      None if uvs is None else uvs[first], used[first],
                      colors=None if colors is None else colors[first])


def _compact(triangles, count):
    """The sorted indices that the triangles use, and the triangles in them."""
    is_used = numpy.zeros(count, bool)
    is_used[triangles.reshape(-1)] = True
    used = numpy.flatnonzero(is_used).astype(numpy.int32)
    place = numpy.zeros(count, numpy.int32)
    place[used] = numpy.arange(len(used), dtype=numpy.int32)
    return used, place[triangles]


def by_material(triangle_materials, slot_count):
    """[(slot, selection of triangles)] of the slots that triangles use. Indices beyond the slots
    mean the last one, as in Blender.
    """
    if slot_count <= 1:
        return [(0, slice(None))]
    slots = numpy.clip(triangle_materials, 0, slot_count - 1)
    counts = numpy.bincount(slots, minlength=slot_count)
    return [(slot, slice(None) if counts[slot] == len(slots) else numpy.flatnonzero(slots == slot))
            for slot in range(slot_count) if counts[slot]]


def area(positions, triangles):
    """The area of the triangles."""
    a, b, c = (positions[triangles[:, i]].astype(numpy.float64) for i in range(3))
    return 0.5 * float(numpy.linalg.norm(numpy.cross(b - a, c - a), axis=1).sum())


def normal_tilt_degrees(arrays):
    """The mean angle between the normals of corners and of their triangles, by area."""
    if arrays.normals is None or len(arrays.triangles) == 0:
        return 0.0
    a, b, c = (arrays.positions[arrays.triangles[:, i]].astype(numpy.float64) for i in range(3))
    faces = numpy.cross(b - a, c - a)
    sizes = numpy.linalg.norm(faces, axis=1)
    if sizes.sum() <= 0:
        return 0.0
    total = 0.0
    for i in range(3):
        cosines = (faces * arrays.normals[arrays.triangles[:, i]]).sum(axis=1)
        total += float((sizes * numpy.arccos(numpy.clip(
            cosines / numpy.maximum(sizes, 1e-300), -1, 1))).sum())
    return math.degrees(total / (3 * float(sizes.sum())))
