# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Blender's units of light as radiance and radiant intensity.

A light of P watts is not P watts of flux for all kinds: Cycles defines for each kind how P becomes
radiance, and these are its definitions (measured with Cycles of Blender 3.4 and 4.3: a camera that
looks at the light, and a plane below it). All values are of linear Rec.709 channels.
"""
import math

import numpy

from . import sphere_map

SUN_DISK_RADIANS_MIN = 0.002  # A sun of less than this diameter casts sharp shadows.
SPOT_MAP_EDGE = 512
BLACKBODY_K = (800.0, 12000.0)  # Cycles' colors end there.


def point_intensity(power_w):
    """W/sr of a point or spot light without size: the power over the whole sphere."""
    return power_w / (4 * math.pi)


def sphere_radiance(power_w, radius_m):
    """Radiance of a sphere whose flux is the power: P / (4 pi r^2) / pi."""
    return power_w / (4 * math.pi**2 * radius_m**2)


def area_radiance(power_w, area_m2, is_flux):
    """Radiance of an area light. is_flux: its flux is the power, as since Blender 4.0; before, it
    is pi / 4 of the power.
    """
    return power_w / ((math.pi if is_flux else 4) * area_m2)


def sun_radiance(irradiance, angle_rad):
    """Radiance of the disk of this diameter that gives a surface which faces it the irradiance."""
    return irradiance / (math.pi * math.sin(angle_rad / 2) ** 2)


def spot_cone(size_rad, blend):
    """Degrees of the cone and of its soft edge: both fall by smoothstep of the cosine.

    size_rad is the full angle; blend, from 0 to 1, is the part of 1 - cos that is soft.
    """
    half = min(size_rad / 2, math.radians(89.99))
    cosine = math.cos(half)
    full_cosine = cosine + (1 - cosine) * min(max(blend, 0.0), 1.0)
    return math.degrees(half), math.degrees(half - math.acos(min(full_cosine, 1.0)))


def spot_map(size_rad, blend, edge=SPOT_MAP_EDGE):
    """An equal-area map of the relative intensity of a spot light that shines along z, before
    Blender 4.0: there it also falls by the cosine.
    """
    places = (numpy.arange(edge) + 0.5) / edge
    cosine = sphere_map.square_to_sphere(*numpy.meshgrid(places, places))[..., 2]
    cone, delta = (math.radians(angle) for angle in spot_cone(size_rad, blend))
    soft = math.cos(cone - delta) - math.cos(cone)
    t = numpy.clip((cosine - math.cos(cone)) / max(soft, 1e-6), 0, 1)
    return numpy.repeat((t * t * (3 - 2 * t) * numpy.maximum(cosine, 0))[..., None], 3, axis=-1)


def area_map(half_spread_rad, edge=SPOT_MAP_EDGE):
    """An equal-area map of the intensity of a point of an area light that shines along z, relative
    to that of a surface of the same flux: cos a (1 - tan a / tan h) / (1 - h / tan h) within the
    angle h of its honeycomb grid, as Cycles has it.
    """
    places = (numpy.arange(edge) + 0.5) / edge
    cosine = sphere_map.square_to_sphere(*numpy.meshgrid(places, places))[..., 2]
    cosine = numpy.maximum(cosine, 0)
    found = cosine
    if half_spread_rad < math.pi / 2 - 1e-4:
        tangent = math.tan(half_spread_rad)
        sine = numpy.sqrt(numpy.maximum(1 - cosine * cosine, 0))
        found = numpy.maximum(cosine - sine / tangent, 0) / (1 - half_spread_rad / tangent)
    return numpy.repeat(found[..., None], 3, axis=-1)


# Cycles' fit of the color of black bodies in linear Rec.709, for temperatures from the first number
# on: a / K + b K + c for red and green, a cubic polynomial of K for blue.
_BLACKBODY = (
    (800, (1.61919106e+03, -2.05010916e-03, 5.02995757),
     (-4.88999748e+02, 6.04330754e-04, -7.55807526e-02),
     (5.96945309e-11, -4.85742887e-08, -9.70622247e-05, -4.07936148e-03)),
    (965, (2.48845471e+03, -1.11330907e-03, 3.22621544),
     (-7.55994277e+02, 3.16730098e-04, 4.78306139e-01),
     (2.40430366e-11, 5.55021075e-08, -1.98503712e-04, 2.89312858e-02)),
    (1167, (3.34143193e+03, -4.86551192e-04, 1.76486769),
     (-1.02363977e+03, 1.20223470e-04, 9.36662319e-01),
     (-1.40949732e-11, 1.89878968e-07, -3.56632824e-04, 9.10767778e-02)),
    (1449, (4.09461742e+03, -1.27446582e-04, 7.25731635e-01),
     (-1.26571316e+03, 4.87340896e-06, 1.27054498),
     (-3.61460868e-11, 2.84822009e-07, -4.93211319e-04, 1.56723440e-01)),
    (1902, (4.67028036e+03, 2.91258199e-05, 1.26703442e-01),
     (-1.42529332e+03, -4.01150431e-05, 1.43972784),
     (-1.97075738e-11, 1.75359352e-07, -2.50542825e-04, -2.22783266e-02)),
    (3315, (4.59509185e+03, 2.87495649e-05, 1.50345020e-01),
     (-1.17554822e+03, -2.16378048e-05, 1.30408023),
     (-1.61997957e-13, -1.64216008e-08, 3.86216271e-04, -7.38077418e-01)),
    (6365, (3.78717450e+03, 9.35907826e-06, 3.99075871e-01),
     (-5.00799571e+02, -4.59832026e-06, 1.09098763),
     (6.72650283e-13, -2.73078809e-08, 4.24098264e-04, -7.52335691e-01)))


def blackbody_rgb(kelvin):
    """Linear Rec.709 color of a black body of luminance 1, as Cycles has it."""
    kelvin = min(max(kelvin, BLACKBODY_K[0]), BLACKBODY_K[1])
    _, red, green, blue = [row for row in _BLACKBODY if row[0] <= kelvin][-1]
    found = [a / kelvin + b * kelvin + c for a, b, c in (red, green)]
    found.append(((blue[0] * kelvin + blue[1]) * kelvin + blue[2]) * kelvin + blue[3])
    return tuple(max(0.0, x) for x in found)
