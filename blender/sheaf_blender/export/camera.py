# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The camera: projection, shift, depth of field and the shutter."""
import dataclasses
import math

import mathutils

# Blender's camera looks along -z, that of the format along z.
_TURN = mathutils.Matrix.Diagonal((1, 1, -1, 1))
LENS_RADIUS_MIN = 1e-6
SHUTTER_POINTS = 33
SHEAR_MIN = 1e-4  # The least cosine between axes that counts; sheared parents shear a camera.


def camera_from_world(matrix):
    """The transform of the camera, without the scale of its object, as in Cycles: each axis has
    length 1, and a mirrored parent mirrors the image.
    """
    axes = matrix.normalized()
    is_turn = axes.determinant() > 0 and all(
        abs(axes.col[i].xyz.dot(axes.col[j].xyz)) < SHEAR_MIN for i, j in ((0, 1), (0, 2), (1, 2)))
    if is_turn:
        location, rotation, _ = matrix.decompose()
        axes = mathutils.Matrix.LocRotScale(location, rotation, None)
    return _TURN @ axes.inverted(axes.inverted_safe())


def affine_inverse(matrix):
    """The inverse of a transform, whose last row is 0 0 0 1."""
    found = matrix.inverted_safe()
    found[3] = (0.0, 0.0, 0.0, 1.0)
    return found


@dataclasses.dataclass(frozen=True)
class State:
    """matrix: world from the camera; window: see _window; focus_m and f-number."""
    matrix: mathutils.Matrix
    window: tuple
    lens: tuple


def state(view, depsgraph, scene):
    """The State of the camera at the time at which depsgraph stands. view: gives the camera's
    object and, of each eye, its matrix and shift; or the region of a viewport.
    """
    if view.region is not None:
        return view.region.state
    camera_object = view.object.evaluated_get(depsgraph)
    return State(view.matrix(camera_object),
                 _window(camera_object.data, scene, view.shift_x(camera_object)),
                 lens_of(camera_object, view.matrix(camera_object)))


def views_of(states, kind):
    """The transforms when the shutter opens and closes, of the States then and, first, that at the
    frame. A lens that zooms or shifts scales and shears the space before the camera.
    """
    frame = states[0]
    return [_zoomed(frame.window, one.window, kind) @ camera_from_world(one.matrix)
            for one in states[1:] or states]


def _zoomed(wanted, present, kind):
    """Maps directions through the present window to those through the wanted one."""
    matrix = mathutils.Matrix.Identity(4)
    if wanted == present or not wanted:
        return matrix
    for axis in (0, 1):
        low, high = wanted[2 * axis:2 * axis + 2]
        now_low, now_high = present[2 * axis:2 * axis + 2]
        scale = (high - low) / (now_high - now_low)
        matrix[axis][axis] = scale
        matrix[axis][3 if kind == "orthographic" else 2] = low - now_low * scale
    return matrix


def pixel_sizes(one, kind, size):
    """A function that gives the size of a pixel at a point of the world."""
    if not one.window:
        return lambda point: 1e-3 * max((point - one.matrix.translation).length, 1e-3)
    pixel = (one.window[1] - one.window[0]) / size[0]
    if kind == "orthographic":
        return lambda point: pixel
    return lambda point: pixel * max((point - one.matrix.translation).length, 1e-3)


def kind_of(camera):
    return {"PANO": "spherical", "ORTHO": "orthographic"}.get(camera.type, "perspective")


def parameters(kind, one):
    """Parameters of the directive Camera for its projection. one: its State."""
    if kind == "spherical":
        return {"string mapping": "equirectangular"}
    found = {"float screenwindow": one.window}
    if kind == "perspective":
        found["float fov"] = 90.0
    return found


def lens_parameters(camera_object, scene, one, shutter, report):
    """Parameters of its lens and shutter; of no lens without an object. shutter: (open, close) or
    None.
    """
    if camera_object is None:
        return {}
    camera = camera_object.data
    item = f'camera "{camera_object.name}"'
    found = {} if camera.type == "PANO" else _lens_parameters(camera.dof, one, item, report)
    if shutter is not None:
        found["float shutteropen"], found["float shutterclose"] = shutter
        shape = _shutter_shape(scene.render.motion_blur_shutter_curve)
        if shape:
            found["float shuttershape"] = shape
    return found


def _shutter_shape(mapping):
    """Pairs of time and openness; () for a shutter that is always open."""
    mapping.initialize()
    curve = mapping.curves[0]
    openness = [max(0.0, mapping.evaluate(curve, i / (SHUTTER_POINTS - 1)))
                for i in range(SHUTTER_POINTS)]
    if min(openness) > 0.999 * max(openness) or max(openness) <= 0:
        return ()
    return tuple(x for i, y in enumerate(openness) for x in (i / (SHUTTER_POINTS - 1), float(y)))


def _window(camera, scene, shift_x):
    """The film's edges: at distance 1 for perspective cameras, whose field of view is set to 90
    degrees, so that the window is in tangents. shift_x: in place of the camera's own.
    """
    if camera.type == "PANO":
        return ()
    corners = camera.view_frame(scene=scene)
    depths = [1.0 if camera.type == "ORTHO" else -corner.z for corner in corners]
    xs = [corner.x / depth for corner, depth in zip(corners, depths)]
    ys = [corner.y / depth for corner, depth in zip(corners, depths)]
    more = 0.0
    if abs(shift_x - camera.shift_x) > 1e-7:
        render = scene.render
        is_wide = (render.resolution_x * render.pixel_aspect_x
                   >= render.resolution_y * render.pixel_aspect_y)
        fits_x = camera.sensor_fit == "HORIZONTAL" or (camera.sensor_fit == "AUTO" and is_wide)
        fitted = max(xs) - min(xs) if fits_x else max(ys) - min(ys)
        more = (shift_x - camera.shift_x) * fitted
    return min(xs) + more, max(xs) + more, min(ys), max(ys)


def lens_of(camera_object, camera_matrix):
    """(radius, distance of focus); () without depth of field."""
    camera = camera_object.data
    dof = camera.dof
    if not dof.use_dof or camera.type == "PANO":
        return ()
    # Cycles: millimeters of focal length as meters; for orthographic cameras a length of 1.
    focal = 1.0 if camera.type == "ORTHO" else camera.lens / 1000
    radius = focal / (2 * max(dof.aperture_fstop, 1e-3))
    if radius < LENS_RADIUS_MIN:
        return ()
    distance = dof.focus_distance
    if dof.focus_object is not None:
        matrix = camera_matrix.normalized()
        offset = dof.focus_object.matrix_world.translation - matrix.translation
        distance = abs(offset.dot(matrix.col[2].to_3d()))
    return radius, max(distance, 1e-4)


def _lens_parameters(dof, one, item, report):
    if not one.lens:
        return {}
    found = {"float lensradius": one.lens[0], "float focaldistance": one.lens[1]}
    if dof.aperture_blades >= 3:
        found["integer blades"] = dof.aperture_blades
        found["float bladerotation"] = math.degrees(dof.aperture_rotation)
    if abs(dof.aperture_ratio - 1) > 1e-3:
        report.left_out(item, "Ratio of the aperture")
    return found


def shutter_of(scene):
    """(open, close) in frames relative to the present one, or None without motion blur."""
    render = scene.render
    if not render.use_motion_blur or render.motion_blur_shutter <= 0:
        return None
    length = render.motion_blur_shutter
    position = getattr(render, "motion_blur_position", None)
    if position is None:  # Before Blender 4.2 it belongs to Cycles.
        position = getattr(getattr(scene, "cycles", None), "motion_blur_position", "CENTER")
    start = {"START": 0.0, "CENTER": -length / 2, "END": -length}[position]
    return start, start + length
