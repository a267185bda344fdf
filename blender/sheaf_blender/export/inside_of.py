# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Which media are around a point, as the camera's."""
import numpy

from ..scene import containment

VOLUMES_MAX = 200    # More are not compared with each other.
OVERLAP_MIN = 1e-3   # A smaller part of a box that overlaps another is rounding.


def media_at(geometries, point):
    """[(geometry, index of its instance, part, or None for a grid)] around the point, in the world,
    of those that the camera sees.
    """
    found = []
    for geometry in geometries:
        if (geometry.medium_grid is None and geometry.smoke is None
                and all(part.shading.medium is None for part in geometry.parts)):
            continue
        if "camera" in geometry.hidden_from:
            continue
        for index, matrix in enumerate(geometry.matrices):
            if matrix is None or is_singular(matrix):
                continue
            local = matrix.inverted() @ point
            if geometry.medium_grid is not None:
                if _in_box(geometry.medium_grid.corners, local):
                    found.append((geometry, index, None))
            elif local.length <= geometry.radius:
                part = containment.nearest_around(tuple(local), [
                    (part.arrays.positions, part.arrays.triangles)
                    for part in geometry.parts if part.arrays is not None])
                if part is not None and geometry.smoke is not None:
                    found.append((geometry, index, None))
                elif part is not None and geometry.parts[part].shading.medium is not None:
                    found.append((geometry, index, geometry.parts[part]))
    return found


def overlaps(geometries):
    """[(name, name of another)] of objects with volumes whose boxes in the world overlap."""
    boxes, found = [], []
    for geometry in geometries:
        corners = _corners(geometry)
        if corners is None:
            continue
        for matrix, name in zip(geometry.matrices, geometry.object_names):
            if matrix is None or len(boxes) >= VOLUMES_MAX:
                continue
            points = corners @ numpy.array(matrix)[:3, :3].T + numpy.array(matrix)[:3, 3]
            low, high = points.min(axis=0), points.max(axis=0)
            found += [(name, other) for other, other_low, other_high in boxes
                      if (numpy.minimum(high, other_high) - numpy.maximum(low, other_low)
                          > OVERLAP_MIN * (high - low)).all()]
            boxes.append((name, low, high))
    return found


def _corners(geometry):
    """The corners of the box around what of a geometry has a volume; None if nothing has."""
    if geometry.medium_grid is not None:
        return numpy.array(geometry.medium_grid.corners)
    arrays = [part.arrays.positions for part in geometry.parts if part.arrays is not None
              and (geometry.smoke is not None or part.shading.medium is not None)]
    if not arrays:
        return None
    ends = [min(a[:, i].min() for a in arrays) for i in range(3)], [
        max(a[:, i].max() for a in arrays) for i in range(3)]
    return numpy.array([[ends[n >> i & 1][i] for i in range(3)] for n in range(8)])


def is_singular(matrix):
    """Whether the matrix makes things flat, so that nothing of them has a volume."""
    scale = [matrix.col[i].xyz.length for i in range(3)]
    return abs(matrix.to_3x3().determinant()) <= 1e-9 * max(scale) ** 3


def is_plane(matrix):
    """Whether a singular matrix leaves an area."""
    lengths = sorted(matrix.col[i].xyz.length for i in range(3))
    sides = [matrix.col[i].xyz.cross(matrix.col[j].xyz).length
             for i, j in ((0, 1), (0, 2), (1, 2))]
    return max(sides) > 1e-9 * lengths[2] ** 2


def _in_box(corners, point):
    return all(min(corner[i] for corner in corners) <= point[i]
               <= max(corner[i] for corner in corners) for i in range(3))
