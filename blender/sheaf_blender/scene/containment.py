# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Whether closed meshes contain a point, by the parity of what rays cross."""
import numpy

# No axis and no diagonal, so that rays seldom run along faces and edges of modelled boxes.
_DIRECTIONS = numpy.array([[0.5377, 0.2641, 0.8007], [-0.7213, 0.6137, 0.3210],
                           [0.1871, -0.8929, -0.4095]])
_DETERMINANT_MIN = 1e-30


def crossings(point, direction, positions, triangles):
    """The distances, along direction, of the triangles that a ray from point crosses."""
    a, b, c = (positions[triangles[:, i]].astype(numpy.float64) for i in range(3))
    ab, ac = b - a, c - a
    p = numpy.cross(direction, ac)
    determinant = (ab * p).sum(axis=1)
    is_flat = numpy.abs(determinant) < _DETERMINANT_MIN
    inverse = 1 / numpy.where(is_flat, 1.0, determinant)
    offset = numpy.asarray(point, numpy.float64) - a
    u = (offset * p).sum(axis=1) * inverse
    q = numpy.cross(offset, ab)
    v = (direction * q).sum(axis=1) * inverse
    t = (ac * q).sum(axis=1) * inverse
    return t[~is_flat & (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)]


def nearest_around(point, parts):
    """The index of the part of a mesh that bounds the space around the point; None outside.

    parts: [(positions, triangles)], closed together. Two of three rays decide.
    """
    votes, nearest = 0, []
    for direction in _DIRECTIONS:
        found = [crossings(point, direction, *part) for part in parts]
        if sum(map(len, found)) % 2:
            votes += 1
            nearest.append(min((float(t.min()), i) for i, t in enumerate(found) if len(t)))
    return min(nearest)[1] if votes >= 2 else None
