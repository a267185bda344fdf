# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The clip planes of the camera, where something that it looks at lies before or behind them. Other
scenes have none: rays that some shapes hide from are rendered by paths from the camera alone.
"""
import mathutils
import numpy

from . import camera as cameras


def parameters(camera, state, geometries):
    """Parameters of the directive Camera: its planes, as Cycles has them. state: a camera.State."""
    view = cameras.camera_from_world(state.matrix)
    kind = cameras.kind_of(camera)
    near, far = float(camera.clip_start), float(camera.clip_end)
    found = {}
    placed = [(geometry, view @ matrix) for geometry in geometries
              for matrix in geometry.matrices if matrix is not None]
    if any(_is_before(geometry, to_view, near, state, kind) for geometry, to_view in placed):
        found["float nearclip"] = near
    if far > near and any(_is_behind(geometry, to_view, far, kind)
                          for geometry, to_view in placed):
        found["float farclip"] = far
    return found


def _reach(geometry, to_view):
    return geometry.radius * max(abs(x) for x in to_view.to_scale())


def _points(part, to_view):
    rows = numpy.array(to_view)
    return part.arrays.positions.astype(numpy.float64) @ rows[:3, :3].T + rows[:3, 3]


def _is_behind(geometry, to_view, far, kind):
    place, reach = to_view.translation, _reach(geometry, to_view)
    if (place.length if kind == "spherical" else place.z) + reach <= far:
        return False
    if geometry.strands or geometry.medium_grid is not None:
        return True
    for part in geometry.parts:
        points = _points(part, to_view)
        depths = numpy.linalg.norm(points, axis=1) if kind == "spherical" else points[:, 2]
        if depths.max(initial=0.0) > far:
            return True
    return False


def _is_before(geometry, to_view, near, state, kind):
    """Whether a triangle meets the box around what the camera sees before its near plane."""
    box = _box(near, state, kind)
    place, reach = to_view.translation, _reach(geometry, to_view)
    outside = mathutils.Vector([max(low - x, x - high, 0.0)
                                for x, (low, high) in zip(place, box)])
    if outside.length >= reach:
        return False
    if geometry.strands:
        return True
    for part in geometry.parts:
        corners = _points(part, to_view)[part.arrays.triangles]
        if _meet_box(corners, numpy.array(box)).any():
            return True
    return False


def _box(near, state, kind):
    """((low, high), ...) along x, y and z."""
    if kind == "spherical":
        return ((-near, near),) * 3
    scale = 1.0 if kind == "orthographic" else near
    lens = state.lens[0] if state.lens else 0.0
    edges = [scale * edge for edge in state.window]
    return ((edges[0] - lens, edges[1] + lens), (edges[2] - lens, edges[3] + lens), (0.0, near))


def _meet_box(corners, box):
    """Whether each of (n, 3, 3) triangles may meet the box: neither a face of the box nor the plane
    of the triangle is between.
    """
    meets = ((corners.max(axis=1) >= box[:, 0]) & (corners.min(axis=1) <= box[:, 1])).all(axis=1)
    normals = numpy.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    center, half = box.mean(axis=1), (box[:, 1] - box[:, 0]) / 2
    away = ((center - corners[:, 0]) * normals).sum(axis=1)
    return meets & (numpy.abs(away) <= numpy.abs(normals) @ half)
