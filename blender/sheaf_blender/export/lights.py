# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Light objects: point, spot, sun and area lights."""
import math

import bpy
import mathutils

from ..scene import ray_visibility, units, values
from . import light_points, node_links, settings
from .images import write_pixels
from .node_values import NodeValues

SIZE_MIN_M = 1e-5           # A light of less is a point.
SUN_DISTANCE_SCENES = 1000  # Distance of a sun's disk, in radii of the scene.


def color_of(light, exposure, report, images):
    """Color times the strength of the light's nodes and the exposure; energy is not in it."""
    color = tuple(exposure * c for c in light.color)
    if getattr(light, "use_temperature", False):
        color = tuple(c * t for c, t in zip(color, units.blackbody_rgb(light.temperature)))
    if not light.use_nodes or light.node_tree is None:
        return color
    item = f'light "{light.name}"'
    output = node_links.output_node(light.node_tree)
    place = output and node_links.source(
        node_links.input_of(node_links.Place(output), "Surface"))[0]
    if place is None:
        return color
    if place.node.type != "EMISSION":
        report.left_out(item, f'node "{place.node.name}"; the light has its color alone')
        return color
    reader = NodeValues(item, report, images)
    found = reader.read(node_links.input_of(place, "Color"))
    if not values.is_constant(found):
        report.left_out(item, "a texture of its color")
        found = (1.0, 1.0, 1.0)
    strength = reader.number(node_links.input_of(place, "Strength"), 1.0)
    return tuple(c * f * strength for c, f in zip(color, values.color(found)))


def write_light(text, place, color, scene_sphere, content, report, groups):
    """Writes a collector.LightPlace. scene_sphere: (center, radius) of what is not at infinity;
    groups: LightGroups.
    """
    light = place.light
    item = f'light "{place.name}"'
    report_common(light, item, report)
    if set(ray_visibility.SCATTERED) <= set(place.hidden_from):
        return
    powers = [c * light.energy for c in color]
    if max(powers) > 0 or min(powers) == 0:
        with text.lights_with(groups.parameters(place.group)):
            _write(text, place, color, scene_sphere, content, report)
    if min(powers) >= 0:
        return
    if not groups.can_subtract:
        report.left_out(item, "its negative power; it gives no light in the channels below 0 (F12 "
                              "without Kinds of Light takes it away)")
        return
    with text.lights_with(groups.parameters(place.group, True)):
        _write(text, place, tuple(-c for c in color), scene_sphere, content, report)


def _write(text, place, color, scene_sphere, content, report):
    """Writes the channels in which color times energy is more than 0."""
    light, matrix = place.light, place.matrix
    item = f'light "{place.name}"'
    if light.type != "SUN" and matrix.to_3x3().determinant() == 0:
        matrix = _unflattened(matrix)
    has_shape = _has_shape(light, matrix)
    is_around = place.is_around and "camera" in place.hidden_from
    if has_shape and (light_points.has_spread(light) or is_around):
        with text.lights_with(_invisible(place, False)):
            _write_points(text, light, matrix, color, content, item, report)
        return
    invisible = _invisible(place, has_shape)
    text.directive("AttributeBegin")
    if has_shape and invisible:  # A shape that blocks no light.
        text.directive("Material", "interface")
        text.directive("Attribute", "shape", invisible)
    with text.lights_with({} if has_shape else invisible):
        _write_one(text, light, matrix, color, scene_sphere, content, item, report)
    text.directive("AttributeEnd")


def _invisible(place, has_shape):
    """"string invisible" of a light. One without a shape is not seen anyway; a shape where the
    camera does not look needs none for that.
    """
    hidden = set(place.hidden_from)
    if not has_shape or (not place.is_seen and hidden <= {"camera", "shadow"}):
        hidden.discard("camera")
    return ray_visibility.parameter(hidden, is_lamp=True)


def _has_shape(light, matrix):
    if light.type == "SUN":
        return light.angle >= units.SUN_DISK_RADIANS_MIN
    if light.type == "AREA":
        return _area_size(light, matrix)[3] > 0
    return light.type == "POINT" and light.shadow_soft_size * matrix.median_scale >= SIZE_MIN_M


def _write_one(text, light, matrix, color, scene_sphere, content, item, report):
    if light.type == "SUN":
        return _sun(text, light, matrix, color, scene_sphere)
    if light.type != "SPOT":
        write_transform(text, matrix, None)
        return {"POINT": _point, "AREA": _area}[light.type](text, light, matrix, color, item,
                                                             report)
    if bpy.app.version < (3, 5, 0):  # Since then its scale makes the cone elliptic.
        matrix = _unscaled(matrix)
    if light_points.has_radius(light):
        return _soft_spot(text, light, matrix, color, content, item, report)
    write_transform(text, matrix, None)
    return _spot(text, light, color, content, item, report)


def _write_points(text, light, matrix, color, content, item, report):
    """An area light with a spread, or a lamp around the camera."""
    report.approximated(item, light_points.NOTE)
    if light.type == "POINT":
        light_points.write_ball(text, matrix.translation, light.shadow_soft_size,
                                _scaled(color, units.point_intensity(light.energy)))
        return
    x, y, is_round, surface = _area_size(light, matrix)
    radiance = units.area_radiance(light.energy, surface, bpy.app.version >= (4, 0, 0))
    light_points.write_area(text, light, matrix, _scaled(color, radiance * surface), content,
                            0 if is_round else 4, (x, y))


def _unflattened(matrix):
    """The matrix with length 1 for the axes that are scaled to 0, which a light ignores."""
    location, rotation, scale = matrix.decompose()
    return mathutils.Matrix.LocRotScale(location, rotation, [x or 1.0 for x in scale])


def _unscaled(matrix):
    location, rotation, scale = matrix.decompose()
    if max(abs(x - 1) for x in scale) < 1e-5:
        return matrix
    return mathutils.Matrix.LocRotScale(location, rotation, None)


def write_transform(text, matrix, motion):
    if motion is None:
        text.transform("ConcatTransform", matrix)
        return
    for time, placed in (("StartTime", matrix), ("EndTime", motion)):
        text.raw("ActiveTransform " + time)
        text.transform("ConcatTransform", placed)
    text.raw("ActiveTransform All")


def report_common(light, item, report):
    settings.note_light(light, item, report)
    if not getattr(light, "use_shadow", True) or not _cycles(light, "cast_shadow", True):
        report.left_out(item, "a light without shadows")
    if _cycles(light, "is_portal", False):
        report.left_out(item, "a portal")


def _cycles(light, name, usual):
    return getattr(getattr(light, "cycles", None), name, usual)


def _scaled(color, factor):
    return tuple(max(0.0, c * factor) for c in color)


def is_in_view(place, view, window, kind):
    """Whether a light that is not a point may be seen. view: from the world to the camera, which
    looks along z.
    """
    if kind == "spherical":
        return True
    is_sun = place.light.type == "SUN"
    axis = place.matrix.to_3x3() @ mathutils.Vector((0, 0, 1))
    center = view.to_3x3() @ axis.normalized() if is_sun else view @ place.matrix.translation
    size = math.tan(min(place.light.angle / 2, 1.5)) if is_sun else _reach(place)
    if kind == "orthographic":
        distance = 1.0
    else:
        distance = center.z
        if distance <= size:
            return distance > -size
    return all(window[2 * i] * distance - size <= center[i] <= window[2 * i + 1] * distance + size
               for i in (0, 1))


def is_around(place, view):
    """Whether a lamp's sphere holds the camera: it shines inwards, too. view: as above."""
    return place.light.type == "POINT" and (
        (view @ place.matrix.translation).length <= place.light.shadow_soft_size)


def _reach(place):
    """The radius of a sphere around a light with a size."""
    light = place.light
    scale = max(abs(x) for x in place.matrix.to_scale())
    if light.type == "AREA":
        return scale * max(light.size, light.size_y)
    return scale * light.shadow_soft_size


def _point(text, light, matrix, color, item, report):
    radius = light.shadow_soft_size
    if radius * matrix.median_scale < SIZE_MIN_M:
        text.directive("LightSource", "point",
                       {"rgb I": _scaled(color, units.point_intensity(light.energy))})
        return
    # The radius does not grow with the object, as in Cycles.
    size = radius / (matrix.median_scale or 1.0)
    radiance = units.sphere_radiance(light.energy, radius)
    text.directive("AreaLightSource", "diffuse", {"rgb L": _scaled(color, radiance)})
    text.directive("Shape", "sphere", {"float radius": float(size)})


def _spot(text, light, color, content, item, report):
    cone, delta = units.spot_cone(light.spot_size, light.spot_blend)
    if light.shadow_soft_size >= SIZE_MIN_M and not light_points.has_radius(light):
        report.approximated(item, "Radius of a spot light is 0: its shadows are sharp")
    intensity = _scaled(color, units.point_intensity(light.energy))
    if bpy.app.version < (4, 0, 0):
        profile = units.spot_map(light.spot_size, light.spot_blend)
        text.raw("Rotate -90 1 0 0")  # pbrt-v4 has the poles of the map along y.
        text.directive("LightSource", "goniometric", {
            "rgb I": intensity, "string filename": write_pixels(content, profile[::-1])})
        return
    text.directive("LightSource", "spot", {
        "rgb I": intensity,
        "point3 from": (0.0, 0.0, 0.0), "point3 to": (0.0, 0.0, -1.0),
        "float coneangle": cone, "float conedeltaangle": max(delta, 0.0)})


def _soft_spot(text, light, matrix, color, content, item, report):
    profile = write_pixels(content, units.spot_map(light.spot_size, light.spot_blend)[::-1])
    light_points.write_spot(text, matrix, light.shadow_soft_size, profile,
                            _scaled(color, units.point_intensity(light.energy)))
    report.approximated(item, f"Radius of a spot light: its shadows have {light_points.POINTS} "
                              "steps")


def _half_angle(light):
    return min(light.angle / 2, math.radians(89))


def _sun(text, light, matrix, color, scene_sphere):
    direction = matrix.to_3x3() @ mathutils.Vector((0, 0, -1))
    direction.normalize()
    if light.angle < units.SUN_DISK_RADIANS_MIN:
        text.directive("LightSource", "distant", {
            "rgb L": _scaled(color, light.energy), "point3 from": tuple(map(float, -direction)),
            "point3 to": (0.0, 0.0, 0.0)})
        return
    center, radius = scene_sphere
    distance = SUN_DISTANCE_SCENES * max(radius, 1e-3)
    half = _half_angle(light)
    # tan: the disk lies at the distance along its axis.
    place = mathutils.Matrix.Translation(center - direction * distance)
    turn = direction.to_track_quat("Z", "Y").to_matrix().to_4x4()
    text.transform("ConcatTransform", place @ turn)
    text.directive("AreaLightSource", "diffuse", {
        "rgb L": _scaled(color, units.sun_radiance(light.energy, 2 * half))})
    text.directive("Shape", "disk", {"float radius": float(distance * math.tan(half))})


def _area_size(light, matrix):
    """(width, height, whether it is round, square meters); Cycles counts the size with the scale
    of the object.
    """
    x = light.size
    y = light.size_y if light.shape in ("RECTANGLE", "ELLIPSE") else light.size
    is_round = light.shape in ("DISK", "ELLIPSE")
    scale = matrix.to_scale()
    return x, y, is_round, abs(x * scale.x * y * scale.y) * (math.pi / 4 if is_round else 1)


def _area(text, light, matrix, color, item, report):
    x, y, is_round, surface = _area_size(light, matrix)
    if surface <= 0:
        report.left_out(item, "an area light without area")
        return
    radiance = units.area_radiance(light.energy, surface, bpy.app.version >= (4, 0, 0))
    text.directive("AreaLightSource", "diffuse", {"rgb L": _scaled(color, radiance)})
    # It shines along -z.
    text.raw(f"Scale {0.5 * x:.9g} {-0.5 * y:.9g} -1")
    if is_round:
        text.directive("Shape", "disk", {"float radius": 1.0})
    else:
        text.directive("Shape", "bilinearmesh", {
            "point3 P": (-1.0, -1.0, 0.0, 1.0, -1.0, 0.0, -1.0, 1.0, 0.0, 1.0, 1.0, 0.0)})
