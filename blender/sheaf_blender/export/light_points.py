# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Lights with size as points: areas with a spread, spots with a radius, and lamps around the
camera. Shadows are soft in as many steps as there are points.
"""
import math

import bpy
import mathutils

from ..scene import units
from .images import write_pixels

POINTS = 64
_GOLDEN = (math.sqrt(5) - 1) / 2
SPREAD_RADIANS_MIN = math.radians(2.0)  # The map of a narrower beam has too few texels.
NOTE = f"it is {POINTS} points: it has no size in reflections, and its shadows have steps"


def write_area(text, light, matrix, intensity, content, corner_count, size):
    """Points of a plane that shines along -z. intensity: of all together, along the axis, for a
    cosine; corner_count: 0 for an ellipse; size: the edges in the object's space.
    """
    half = light_spread(light) / 2
    profile = write_pixels(content, units.area_map(half)[::-1])
    normal = matrix.to_3x3().col[2].normalized()
    turn = (-normal).to_track_quat("-Z", "Y").to_matrix().to_4x4()
    for u, v in square_points(*size) if corner_count else disk_points():
        center = matrix @ mathutils.Vector((u * size[0] / 2, v * size[1] / 2, 0))
        write_map(text, mathutils.Matrix.Translation(center) @ turn, profile,
                  _shared(intensity))


def write_ball(text, center, radius, intensity):
    for offset in ball_points(radius):
        text.directive("LightSource", "point", {
            "rgb I": _shared(intensity), "point3 from": tuple(map(float, center + offset))})


def write_spot(text, matrix, radius, profile, intensity):
    """matrix: without scale; the light shines along -z."""
    for offset in ball_points(radius):
        write_map(text, mathutils.Matrix.Translation(offset) @ matrix, profile, _shared(intensity))


def write_map(text, matrix, profile, intensity):
    """A point light with a map around its axis -z."""
    text.directive("AttributeBegin")
    text.transform("ConcatTransform", matrix)
    text.raw("Rotate -90 1 0 0")  # pbrt-v4 has the poles of the map along y.
    text.directive("LightSource", "goniometric", {
        "rgb I": intensity, "string filename": profile})
    text.directive("AttributeEnd")


def light_spread(light):
    """The full angle in which an area light shines."""
    return min(max(getattr(light, "spread", math.pi), SPREAD_RADIANS_MIN), math.pi)


def has_spread(light):
    return light.type == "AREA" and light_spread(light) < math.pi - 1e-3


def has_radius(light):
    """Whether a spot's radius softens its shadows; since Blender 4.0 its map has another form."""
    return (light.type == "SPOT" and light.shadow_soft_size > 1e-5
            and bpy.app.version < (4, 0, 0))


def _shared(intensity):
    return tuple(c / POINTS for c in intensity)


def square_points(width, height):
    """Centers of about POINTS even cells of the square from -1 to 1; the cells of long strips are
    as long as wide.
    """
    ratio = abs(width / height) if height else 1.0
    columns = min(max(2 ** round(math.log2(math.sqrt(POINTS * ratio))), 1), POINTS)
    rows = POINTS // columns
    return [(2 * (i + 0.5) / columns - 1, 2 * (j + 0.5) / rows - 1)
            for i in range(columns) for j in range(rows)]


def disk_points():
    """Points evenly in the unit disk: a sunflower (Vogel, A better way to construct the sunflower
    head, 1979).
    """
    found = []
    for i in range(POINTS):
        radius, angle = math.sqrt((i + 0.5) / POINTS), 2 * math.pi * _GOLDEN * i
        found.append((radius * math.cos(angle), radius * math.sin(angle)))
    return found


def ball_points(radius):
    """Points in a ball that are an even disk from all sides: with the density 1 / sqrt(1 - r^2),
    whose integral along a line is constant.
    """
    found = []
    for i in range(POINTS):
        z = 1 - 2 * (i + 0.5) / POINTS
        angle, share = 2 * math.pi * _GOLDEN * i, (0.5 + i * math.sqrt(2)) % 1.0
        length = radius * math.sin(_inverse_share(share))
        flat = math.sqrt(1 - z * z)
        found.append(length * mathutils.Vector((flat * math.cos(angle), flat * math.sin(angle), z)))
    return found


def _inverse_share(share):
    """The angle a below 90 degrees with (a - sin a cos a) / (pi / 2) = share, by bisection."""
    low, high = 0.0, math.pi / 2
    for _ in range(40):
        middle = (low + high) / 2
        if middle - math.sin(middle) * math.cos(middle) < share * math.pi / 2:
            low = middle
        else:
            high = middle
    return (low + high) / 2
