# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Closed forms that the expected values of the cases come from; nothing here knows Sheaf.

Sources: CIE 15:2004 (color matching functions), IEC 61966-2-1 (sRGB), CODATA (Planck's law), Born
and Wolf (Fresnel), Walter et al. 2007 (GGX).
"""
import math

import numpy as np

NM = np.arange(360, 831)
CMF_X = (
    0.0001299, 0.0002321, 0.0004149, 0.0007416, 0.001368, 0.002236, 0.004243, 0.00765, 0.01431,
    0.02319, 0.04351, 0.07763, 0.13438, 0.21477, 0.2839, 0.3285, 0.34828, 0.34806, 0.3362,
    0.3187, 0.2908, 0.2511, 0.19536, 0.1421, 0.09564, 0.05795, 0.03201, 0.0147, 0.0049, 0.0024,
    0.0093, 0.0291, 0.06327, 0.1096, 0.1655, 0.22575, 0.2904, 0.3597, 0.43345, 0.51205, 0.5945,
    0.6784, 0.7621, 0.8425, 0.9163, 0.9786, 1.0263, 1.0567, 1.0622, 1.0456, 1.0026, 0.9384,
    0.85445, 0.7514, 0.6424, 0.5419, 0.4479, 0.3608, 0.2835, 0.2187, 0.1649, 0.1212, 0.0874,
    0.0636, 0.04677, 0.0329, 0.0227, 0.01584, 0.0113592, 0.00811092, 0.00579035, 0.00410946,
    0.00289933, 0.00204919, 0.00143997, 0.000999949, 0.000690079, 0.000476021, 0.000332301,
    0.000234826, 0.000166151, 0.000117413, 8.30753e-05, 5.87065e-05, 4.15099e-05, 2.93533e-05,
    2.06738e-05, 1.45598e-05, 1.0254e-05, 7.22146e-06, 5.08587e-06, 3.58165e-06, 2.52253e-06,
    1.77651e-06, 1.25114e-06)

CMF_Y = (
    3.917e-06, 6.965e-06, 1.239e-05, 2.202e-05, 3.9e-05, 6.4e-05, 0.00012, 0.000217, 0.000396,
    0.00064, 0.00121, 0.00218, 0.004, 0.0073, 0.0116, 0.01684, 0.023, 0.0298, 0.038, 0.048,
    0.06, 0.0739, 0.09098, 0.1126, 0.13902, 0.1693, 0.20802, 0.2586, 0.323, 0.4073, 0.503,
    0.6082, 0.71, 0.7932, 0.862, 0.91485, 0.954, 0.9803, 0.99495, 1, 0.995, 0.9786, 0.952,
    0.9154, 0.87, 0.8163, 0.757, 0.6949, 0.631, 0.5668, 0.503, 0.4412, 0.381, 0.321, 0.265,
    0.217, 0.175, 0.1382, 0.107, 0.0816, 0.061, 0.04458, 0.032, 0.0232, 0.017, 0.01192, 0.00821,
    0.005723, 0.004102, 0.002929, 0.002091, 0.001484, 0.001047, 0.00074, 0.00052, 0.0003611,
    0.0002492, 0.0001719, 0.00012, 8.48e-05, 6e-05, 4.24e-05, 3e-05, 2.12e-05, 1.499e-05,
    1.06e-05, 7.4657e-06, 5.2578e-06, 3.7029e-06, 2.6078e-06, 1.8366e-06, 1.2934e-06,
    9.1093e-07, 6.4153e-07, 4.5181e-07)

CMF_Z = (
    0.0006061, 0.001086, 0.001946, 0.003486, 0.00645, 0.01055, 0.02005, 0.03621, 0.06785,
    0.1102, 0.2074, 0.3713, 0.6456, 1.03905, 1.3856, 1.62296, 1.74706, 1.7826, 1.77211, 1.7441,
    1.6692, 1.5281, 1.28764, 1.0419, 0.81295, 0.6162, 0.46518, 0.3533, 0.272, 0.2123, 0.1582,
    0.1117, 0.07825, 0.05725, 0.04216, 0.02984, 0.0203, 0.0134, 0.00875, 0.00575, 0.0039,
    0.00275, 0.0021, 0.0018, 0.00165, 0.0014, 0.0011, 0.001, 0.0008, 0.0006, 0.00034, 0.00024,
    0.00019, 0.0001, 5e-05, 3e-05, 2e-05, 1e-05, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)
CMF = np.array([np.interp(NM, np.arange(360, 831, 5), c) for c in (CMF_X, CMF_Y, CMF_Z)])
RGB_FROM_XYZ = np.array([[3.2404542, -1.5371385, -0.4985314],
                         [-0.9692660, 1.8760108, 0.0415560],
                         [0.0556434, -0.2040259, 1.0572252]])


def rgb_of_xy(x, y, luminance=1):
    """Linear sRGB of a light of a chromaticity."""
    return luminance * RGB_FROM_XYZ @ np.array([x / y, 1, (1 - x - y) / y])


def rgb_of_light(spectrum, reflectance=1):
    """Linear sRGB of a light of luminance 1, after a surface that reflects a part of it."""
    values = np.array([spectrum(nm) for nm in NM])
    parts = values * np.array([reflectance(nm) for nm in NM] if callable(reflectance)
                              else reflectance)
    return RGB_FROM_XYZ @ (CMF @ parts) / (CMF[1] @ values)


def planck(kelvin):
    """Spectral radiance of a black body, up to a factor, by wavelength in nm."""
    return lambda nm: 1e14 / nm ** 5 / math.expm1(1.438777e7 / (nm * kelvin))


def table(*pairs):
    """A spectrum that is linear between its points and 0 beyond."""
    return lambda nm: np.interp(nm, pairs[0::2], pairs[1::2], left=0, right=0)


def fresnel(cosine, eta, k=0):
    """Reflectance of unpolarized light; eta and k relative to the outside."""
    sine2 = 1 - cosine * cosine
    index = complex(eta, k)
    inner = np.sqrt(index * index - sine2)
    s = (cosine - inner) / (cosine + inner)
    p = (index * index * cosine - inner) / (index * index * cosine + inner)
    return (abs(s) ** 2 + abs(p) ** 2) / 2


def ggx(x, y, alpha_x, alpha_y):
    """Density of normals at slopes x and y, over projected solid angle."""
    cos2 = 1 / (1 + x * x + y * y)
    term = 1 + x * x / alpha_x ** 2 + y * y / alpha_y ** 2
    return 1 / (math.pi * alpha_x * alpha_y * cos2 ** 2 * term ** 2)


def smith_lambda(w, alpha_x, alpha_y):
    """Smith's Lambda of GGX for a direction w about z."""
    tan2 = ((w[0] * alpha_x) ** 2 + (w[1] * alpha_y) ** 2) / w[2] ** 2
    return (math.sqrt(1 + tan2) - 1) / 2


def henyey_greenstein(cosine, g):
    """Phase function; cosine of the angle by which light turns."""
    return (1 - g * g) / (4 * math.pi * (1 + g * g - 2 * g * cosine) ** 1.5)


def clip(polygon, axis, limit, sign):
    """The part of a convex polygon where sign * (p[axis] - limit) >= 0."""
    kept = []
    for a, b in zip(polygon, polygon[1:] + polygon[:1]):
        da, db = sign * (a[axis] - limit), sign * (b[axis] - limit)
        if da >= 0:
            kept.append(a)
        if da * db < 0:
            t = da / (da - db)
            kept.append((a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])))
    return kept


def area(polygon):
    return abs(sum(a[0] * b[1] - b[0] * a[1]
                   for a, b in zip(polygon, polygon[1:] + polygon[:1]))) / 2


def coverage(polygon, width, height):
    """Share of each pixel that a convex polygon in raster coordinates covers."""
    image = np.zeros((height, width))
    for y in range(height):
        for x in range(width):
            part = [tuple(p) for p in polygon]
            for axis, low in ((0, x), (1, y)):
                part = clip(part, axis, low, 1) if part else part
                part = clip(part, axis, low + 1, -1) if part else part
            image[y, x] = area(part) if len(part) > 2 else 0
    return image


def normalize(v):
    v = np.array(v, dtype=float)
    return v / np.linalg.norm(v)


def translate(x, y, z):
    m = np.eye(4)
    m[:3, 3] = x, y, z
    return m


def scale(x, y, z):
    return np.diag([x, y, z, 1.0])


def rotate(degrees, axis):
    """Rodrigues' formula."""
    a, t = normalize(axis), math.radians(degrees)
    cross = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    m = np.eye(4)
    m[:3, :3] = np.eye(3) + math.sin(t) * cross + (1 - math.cos(t)) * cross @ cross
    return m


def look_at(eye, at, up):
    """Camera from world; the camera looks along +z, x is to the right, y up."""
    z = normalize(np.subtract(at, eye))
    x = normalize(np.cross(normalize(up), z))
    m = np.eye(4)
    m[:3, :3] = [x, np.cross(z, x), z]
    m[:3, 3] = -m[:3, :3] @ np.array(eye, dtype=float)
    return m


def apply(matrix, point):
    p = matrix @ np.append(np.array(point, dtype=float), 1)
    return p[:3] / p[3]
