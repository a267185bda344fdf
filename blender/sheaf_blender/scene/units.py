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


def blackbody_rgb(kelvin):
    """Linear Rec.709 color of a black body of luminance 1, by the CIE 1931 observer.

    The observer: Wyman, Sloan and Shirley 2013, "Simple Analytic Approximations to the CIE XYZ
    Color Matching Functions", JCGT 2(2), its multi-lobe fit.
    """
    kelvin = min(max(kelvin, BLACKBODY_K[0]), BLACKBODY_K[1])

    def lobe(x, mean, low, high):
        return math.exp(-0.5 * ((x - mean) * (low if x < mean else high)) ** 2)
    xyz = [0.0, 0.0, 0.0]
    for nm in range(380, 781, 5):
        radiance = nm**-5.0 * 1e13 / math.expm1(1.438777e7 / (nm * kelvin))
        x = (1.056 * lobe(nm, 599.8, 0.0264, 0.0323) + 0.362 * lobe(nm, 442.0, 0.0624, 0.0374)
             - 0.065 * lobe(nm, 501.1, 0.0490, 0.0382))
        y = 0.821 * lobe(nm, 568.8, 0.0213, 0.0247) + 0.286 * lobe(nm, 530.9, 0.0613, 0.0322)
        z = 1.217 * lobe(nm, 437.0, 0.0845, 0.0278) + 0.681 * lobe(nm, 459.0, 0.0385, 0.0725)
        for i, response in enumerate((x, y, z)):
            xyz[i] += radiance * response
    x, y, z = (value / xyz[1] for value in xyz)
    return (max(0.0, 3.2404542 * x - 1.5371385 * y - 0.4985314 * z),
            max(0.0, -0.9692660 * x + 1.8760108 * y + 0.0415560 * z),
            max(0.0, 0.0556434 * x - 0.2040259 * y + 1.0572252 * z))
