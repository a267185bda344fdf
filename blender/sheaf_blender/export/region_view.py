# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The view of a region of the 3D viewport: the projection, the place, and the part of it that is
rendered.
"""
import dataclasses
import math

import mathutils

from . import camera


@dataclasses.dataclass(frozen=True)
class Region:
    """kind, state: as of cameras; lens_object: the camera with depth of field that is looked
    through, or None; window: x0, x1, y0, y1 of its pixels from the top, or () for all.
    """
    kind: str
    state: camera.State
    lens_object: object
    size: tuple
    window: tuple

    def is_like(self, other):
        """Whether both have the same image of one scene."""
        return other is not None and _numbers(self) == _numbers(other)


class RegionView:
    """In place of engine.ViewCamera. object: the camera that is looked through, or None."""

    def __init__(self, region, camera_object):
        self.region, self.object = region, camera_object


def _numbers(region):
    return (region.kind, region.size, region.window, region.state.window, region.state.lens,
            tuple(tuple(row) for row in region.state.matrix),
            _blades(region.lens_object))


def _blades(lens_object):
    if lens_object is None:
        return ()
    dof = lens_object.data.dof
    return dof.aperture_blades, dof.aperture_rotation


def read(size, view_3d, space, scene, camera_object):
    """The Region of a view. size: in pixels; view_3d: a RegionView3D; space: a SpaceView3D;
    camera_object: the evaluated camera of the space, or None.
    """
    is_camera = view_3d.view_perspective == "CAMERA" and camera_object is not None
    kind = "perspective" if view_3d.is_perspective else "orthographic"
    matrix = camera.affine_inverse(view_3d.view_matrix)
    edges = edges_of(view_3d.window_matrix, kind)
    if kind == "orthographic" and not is_camera:
        # Such a view also shows what is behind its place.
        away = matrix.col[2].xyz * (space.clip_end / 2)
        matrix = mathutils.Matrix.Translation(away) @ matrix
    lens = ()
    if is_camera and camera_object.type == "CAMERA":
        lens = camera.lens_of(camera_object, camera_object.matrix_world)
    return Region(kind, camera.State(matrix, edges, lens), camera_object if lens else None, size,
                  _window(size, edges, kind, space, scene, camera_object if is_camera else None))


def edges_of(matrix, kind):
    """The film's edges of a projection matrix, as of camera.State.window."""
    found = []
    for axis in (0, 1):
        scale = matrix[axis][axis]
        offset = matrix[axis][3] * -1 if kind == "orthographic" else matrix[axis][2]
        found += [(offset - 1) / scale, (offset + 1) / scale]
    return tuple(found)


def _window(size, edges, kind, space, scene, camera_object):
    """The border of the view in pixels; () without one."""
    render = scene.render
    if camera_object is None:
        if not space.use_render_border:
            return ()
        border = (space.render_border_min_x, space.render_border_max_x,
                  space.render_border_min_y, space.render_border_max_y)
        frame = (0.0, 1.0, 0.0, 1.0)
    else:
        if not render.use_border or camera_object.type != "CAMERA":
            return ()
        border = (render.border_min_x, render.border_max_x, render.border_min_y,
                  render.border_max_y)
        frame = _frame(edges, kind, camera_object, scene)
    x0, x1 = (frame[0] + (frame[1] - frame[0]) * edge for edge in border[:2])
    y0, y1 = (frame[2] + (frame[3] - frame[2]) * edge for edge in border[2:])
    window = (max(0, round(x0 * size[0])), min(size[0], round(x1 * size[0])),
              max(0, round((1 - y1) * size[1])), min(size[1], round((1 - y0) * size[1])))
    # A border outside of the region leaves one pixel: an image has some.
    left, top = min(window[0], size[0] - 1), min(window[2], size[1] - 1)
    return left, max(left + 1, window[1]), top, max(top + 1, window[3])


def _frame(edges, kind, camera_object, scene):
    """The frame of a camera that is looked through, as parts of the region: left, right, bottom,
    top.
    """
    corners = camera_object.data.view_frame(scene=scene)
    depths = [1.0 if kind == "orthographic" else -corner.z for corner in corners]
    xs = [corner.x / depth for corner, depth in zip(corners, depths)]
    ys = [corner.y / depth for corner, depth in zip(corners, depths)]
    left, right, bottom, top = edges
    return ((min(xs) - left) / (right - left), (max(xs) - left) / (right - left),
            (min(ys) - bottom) / (top - bottom), (max(ys) - bottom) / (top - bottom))


def is_finite(region):
    """Whether a region can be rendered; a region that is being made has no view yet."""
    return min(region.size) > 0 and all(
        math.isfinite(x) for row in region.state.matrix for x in row) and all(
            math.isfinite(x) for x in region.state.window) and (
                region.state.window[0] < region.state.window[1])
