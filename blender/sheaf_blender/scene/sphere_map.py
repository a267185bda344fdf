# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Environment maps: from latitude and longitude, as Blender has them, to the equal-area squares of
pbrt-v4.

The square: Clarberg 2008, "Fast Equal-Area Mapping of the (Hemi)Sphere using SIMD", Journal of
Graphics Tools 13(3), as pbrt-v4 orients it.
"""
import numpy

EDGE_MIN, EDGE_MAX = 16, 8192
_SUBSAMPLES = 3  # In each direction of a texel.


def square_to_sphere(u, v):
    """Directions (..., 3) of points of the unit square."""
    u, v = 2 * u - 1, 2 * v - 1
    up, vp = numpy.abs(u), numpy.abs(v)
    signed_distance = 1 - (up + vp)
    d = numpy.abs(signed_distance)
    r = 1 - d
    with numpy.errstate(invalid="ignore", divide="ignore"):
        phi = numpy.where(r == 0, 1.0, (vp - up) / r + 1) * (numpy.pi / 4)
    z = numpy.copysign(1 - r * r, signed_distance)
    cos_phi = numpy.copysign(numpy.cos(phi), u)
    sin_phi = numpy.copysign(numpy.sin(phi), v)
    s = r * numpy.sqrt(numpy.maximum(2 - r * r, 0))
    return numpy.stack([cos_phi * s, sin_phi * s, z], axis=-1)


def direction_to_equirectangular(directions):
    """Blender's (u, v) of directions: u falls with the angle around z, v rises with z."""
    x, y, z = (directions[..., i] for i in range(3))
    u = 0.5 - numpy.arctan2(y, x) / (2 * numpy.pi)
    v = numpy.arctan2(z, numpy.hypot(x, y)) / numpy.pi + 0.5
    return u, v


def bilinear(pixels, u, v):
    """Looks up pixels (rows from the bottom); u wraps around, v ends at the poles."""
    height, width = pixels.shape[:2]
    x, y = u * width - 0.5, numpy.clip(v * height - 0.5, 0, height - 1)
    x0, y0 = numpy.floor(x).astype(int), numpy.floor(y).astype(int)
    fx = (x - x0)[..., None].astype(numpy.float32)
    fy = (y - y0)[..., None].astype(numpy.float32)
    x1, y1 = (x0 + 1) % width, numpy.minimum(y0 + 1, height - 1)
    x0 = x0 % width
    low = pixels[y0, x0] * (1 - fx) + pixels[y0, x1] * fx
    high = pixels[y1, x0] * (1 - fx) + pixels[y1, x1] * fx
    return low * (1 - fy) + high * fy


def direction_to_mirror_ball(directions):
    """Blender's (u, v) in the photograph of a mirroring ball."""
    x, y, z = (directions[..., i] for i in range(3))
    length = numpy.sqrt(x * x + y * y + z * z)
    y = y - length
    half = 2 * numpy.sqrt(numpy.maximum(-0.5 * y * length, 0))
    safe = numpy.where(half > 0, half, 1)
    return 0.5 * (x / safe + 1), 0.5 * (z / safe + 1)


def look_up(pixels, directions, lookup, projection="EQUIRECTANGULAR"):
    """Pixels (rows from the bottom) in directions (..., 3), which the 4x4 matrix maps before."""
    mapped = directions @ lookup[:3, :3].T + lookup[:3, 3]
    project = (direction_to_mirror_ball if projection == "MIRROR_BALL"
               else direction_to_equirectangular)
    return bilinear(pixels, *project(mapped))


def equal_area_from_equirectangular(pixels, edge=None):
    """The equal-area square of an image by latitude and longitude; see equal_area."""
    return equal_area(pixels, numpy.eye(4), "EQUIRECTANGULAR", edge)


def equal_area(pixels, lookup, projection, edge=None):
    """pixels: (height, width, 3) float32, rows from the bottom; lookup and projection: see look_up.
    Returns (edge, edge, 3), rows of rising v. A texel is the mean over its subsamples, so that
    small suns keep their light.
    """
    if edge is None:
        edge = int(min(max(round((pixels.shape[0] * pixels.shape[1]) ** 0.5), EDGE_MIN), EDGE_MAX))
    result = numpy.zeros((edge, edge, 3), numpy.float32)
    places = numpy.arange(edge)
    for i in range(_SUBSAMPLES):
        for j in range(_SUBSAMPLES):
            u, v = numpy.meshgrid((places + (i + 0.5) / _SUBSAMPLES) / edge,
                                  (places + (j + 0.5) / _SUBSAMPLES) / edge)
            result += look_up(pixels, square_to_sphere(u, v), lookup, projection)
    return result / _SUBSAMPLES**2
