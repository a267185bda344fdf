# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The camera: projection, shift, depth of field and the shutter."""
import math

import mathutils

# Blender's camera looks along -z, that of the format along z.
_TURN = mathutils.Matrix.Diagonal((1, 1, -1, 1))
LENS_RADIUS_MIN = 1e-6


def camera_from_world(camera_object):
    """The transform of the camera, without the scale of its object, as in Cycles."""
    location, rotation, _ = camera_object.matrix_world.decompose()
    return _TURN @ mathutils.Matrix.LocRotScale(location, rotation, None).inverted()


def parameters(camera_object, scene, shutter, report):
    """(kind, parameters) of the directive Camera. shutter: (open, close) or None."""
    camera = camera_object.data
    item = f'camera "{camera_object.name}"'
    found = {}
    if camera.type == "PANO":
        kind = "spherical"
        found["string mapping"] = "equirectangular"
        report.approximated(item, "a panorama is a full equirectangular one")
    else:
        kind = "orthographic" if camera.type == "ORTHO" else "perspective"
        found.update(_window(camera, scene))
        found.update(_lens(camera_object, camera, item, report))
    if camera.clip_start > 0.11 and camera.type != "PANO":
        report.left_out(item, "Clip Start: nearer objects are visible")
    if shutter is not None:
        found["float shutteropen"], found["float shutterclose"] = shutter
    return kind, found


def _window(camera, scene):
    """The film's edges: at distance 1 for perspective cameras, whose field of view is set to 90
    degrees, so that the window is in tangents.
    """
    corners = camera.view_frame(scene=scene)
    depths = [1.0 if camera.type == "ORTHO" else -corner.z for corner in corners]
    xs = [corner.x / depth for corner, depth in zip(corners, depths)]
    ys = [corner.y / depth for corner, depth in zip(corners, depths)]
    window = {"float screenwindow": (min(xs), max(xs), min(ys), max(ys))}
    if camera.type != "ORTHO":
        window["float fov"] = 90.0
    return window


def _lens(camera_object, camera, item, report):
    dof = camera.dof
    if not dof.use_dof:
        return {}
    # Cycles: millimeters of focal length as meters; for orthographic cameras a length of 1.
    focal = 1.0 if camera.type == "ORTHO" else camera.lens / 1000
    radius = focal / (2 * max(dof.aperture_fstop, 1e-3))
    if radius < LENS_RADIUS_MIN:
        return {}
    distance = dof.focus_distance
    if dof.focus_object is not None:
        matrix = camera_object.matrix_world.normalized()
        offset = dof.focus_object.matrix_world.translation - matrix.translation
        distance = abs(offset.dot(matrix.col[2].to_3d()))
    found = {"float lensradius": radius, "float focaldistance": max(distance, 1e-4)}
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
