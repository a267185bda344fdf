# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Films and reconstruction filters: a lamp's edge after each filter, and what a film does to it."""
import math

import numpy as np

import closed_forms as cf
from scenes import case, film, lamp, rectangle, scene, LOOK, SIZE

STEPS = 400


def box(x, radius):
    return np.where(np.abs(x) <= radius, 1.0, 0)


def triangle(x, radius):
    return np.maximum(0, radius - np.abs(x))


def gaussian(x, radius, sigma):
    end = math.exp(-radius ** 2 / (2 * sigma ** 2))
    return np.maximum(0, np.exp(-x * x / (2 * sigma ** 2)) - end)


def mitchell(x, radius, b, c):
    """Mitchell and Netravali 1988, with the radius at their 2."""
    x = np.abs(2 * x / radius)
    near = ((12 - 9 * b - 6 * c) * x ** 3 + (-18 + 12 * b + 6 * c) * x ** 2 + (6 - 2 * b)) / 6
    far = ((-b - 6 * c) * x ** 3 + (6 * b + 30 * c) * x ** 2 + (-12 * b - 48 * c) * x +
           (8 * b + 24 * c)) / 6
    return np.where(x <= 1, near, np.where(x <= 2, far, 0))


def sinc(x, radius, tau):
    def lobe(v):
        return np.sinc(v)
    return np.where(np.abs(x) > radius, 0, lobe(x) * lobe(x / tau))


def edge(kernel, radius, at):
    """Pixels in a row where all beyond raster position `at` shines."""
    x = (np.arange(2 * STEPS) + .5) / STEPS * radius - radius
    weights = kernel(x)
    weights = weights / weights.sum()
    return np.array([(weights * (i + .5 + x > at)).sum() for i in range(SIZE)])


def filters():
    def both(name, text, kernel_x, radius_x, kernel_y=None, radius_y=None, at=4.3):
        # Lobes that take away make noise.
        samples = 4096 if "sinc" in name or "mitchell" in name else 512
        position = (at - 4) / 4
        want = np.tile(edge(kernel_x, radius_x, at), (SIZE, 1))
        case(f"filter {name}, across", scene(lamp(rectangle(position, 9, -9, 9)),
                                             pixel_filter=text, samples=samples), want)
        down = edge(kernel_y or kernel_x, radius_y or radius_x, at)
        case(f"filter {name}, down", scene(lamp(rectangle(-9, 9, -9, -position)), samples=samples,
                                           pixel_filter=text), np.tile(down[:, None], (1, SIZE)))

    both("box", "box", lambda x: box(x, .5), .5)
    both("box of 1.5 by 1", 'box" "float xradius" 1.5 "float yradius" 1 #', lambda x: box(x, 1.5),
         1.5,
         lambda x: box(x, 1), 1)
    both("triangle", "triangle", lambda x: triangle(x, 2), 2)
    both("triangle of 1 by 1.5", 'triangle" "float xradius" 1 "float yradius" 1.5 #',
         lambda x: triangle(x, 1), 1, lambda x: triangle(x, 1.5), 1.5)
    both("gaussian", "gaussian", lambda x: gaussian(x, 1.5, .5), 1.5)
    both("gaussian of sigma .8", 'gaussian" "float sigma" .8 "float xradius" 2 "float yradius" 3 #',
         lambda x: gaussian(x, 2, .8), 2, lambda x: gaussian(x, 3, .8), 3)
    both("mitchell", "mitchell", lambda x: mitchell(x, 2, 1 / 3, 1 / 3), 2)
    both("mitchell of B 1 C 0", 'mitchell" "float B" 1 "float C" 0 #',
         lambda x: mitchell(x, 2, 1, 0), 2)
    both("mitchell of B 0 C .5", 'mitchell" "float B" 0 "float C" .5 "float xradius" 3 '
         '"float yradius" 2.5 #', lambda x: mitchell(x, 3, 0, .5), 3,
         lambda x: mitchell(x, 2.5, 0, .5), 2.5)
    both("sinc", "sinc", lambda x: sinc(x, 4, 3), 4)
    both("sinc of tau 2", 'sinc" "float tau" 2 "float xradius" 3 "float yradius" 2 #',
         lambda x: sinc(x, 3, 2), 3, lambda x: sinc(x, 2, 2), 2)


def films():
    color = (.2, .5, .8)
    glow = lamp(rectangle(-9, 9, -9, 9), '"rgb L" [.2 .5 .8]')

    def of(name, more, want, camera="", **rest):
        case("film " + name, scene(glow, films=film(more=more),
                                   camera=f'{LOOK}Camera "orthographic" {camera}\n', **rest), want)

    of("default", "", color)
    of("filename", '"string filename" "other.exr"', color)
    of("savefp16", '"bool savefp16" true', color)
    of("diagonal", '"float diagonal" 50', color)
    of("maxcomponentvalue above", '"float maxcomponentvalue" 100', color)
    # X, Y and Z of the color are scaled so that the largest of them is the limit.
    xyz = np.linalg.inv(cf.RGB_FROM_XYZ) @ np.array(color)
    of("maxcomponentvalue below", '"float maxcomponentvalue" .25',
       np.array(color) * .25 / xyz.max())
    of("sensor cie1931", '"string sensor" "cie1931"', color, color="spectral", samples=512)
    of("sensor cie1931, iso 300", '"string sensor" "cie1931" "float iso" 300', np.array(color) * 3,
       color="spectral", samples=512)
    # pbrt-v4 makes it darker; docs/pbrt-v4.md says why the mean over time is kept here.
    of("sensor cie1931, shutter of .25", '"string sensor" "cie1931"', color,
       '"float shutteropen" 0 "float shutterclose" .25', color="spectral", samples=512)
    case("film of one pixel", scene(glow, films=film(1, 1)), color)
    case("film of 3 by 5", scene(glow, films=film(3, 5)), np.tile(color, (5, 3, 1)))
    case("film gbuffer", scene(glow).replace('Film "rgb"', 'Film "gbuffer"'), color)
    color = (.5, .6, .8)  # Within sRGB in each of the spaces.
    glow = lamp(rectangle(-9, 9, -9, 9), '"rgb L" [.5 .6 .8]')
    # The columns are the primaries with their white scaled to 1.
    for name, primaries, white in (("rec2020", (.708, .292, .170, .797, .131, .046),
                                    (.3127, .3290)),
                                   ("dci-p3", (.680, .320, .265, .690, .150, .060),
                                    (.3127, .3290))):
        m = np.array([[primaries[i] / primaries[i + 1], 1,
                       (1 - primaries[i] - primaries[i + 1]) / primaries[i + 1]]
                      for i in (0, 2, 4)]).T
        w = np.array([white[0] / white[1], 1, (1 - white[0] - white[1]) / white[1]])
        m = m * np.linalg.solve(m, w)
        srgb = np.linalg.inv(cf.RGB_FROM_XYZ)
        case(f"film of ColorSpace {name}",
             scene(glow, before=f'ColorSpace "{name}"\n'), color)
        case(f"ColorSpace {name} of a light", scene(f'ColorSpace "{name}"\n' + glow),
             np.linalg.inv(srgb) @ m @ np.array(color))
        case(f"ColorSpace {name} of the film alone",
             scene('ColorSpace "srgb"\n' + glow, before=f'ColorSpace "{name}"\n'),
             np.linalg.inv(m) @ srgb @ np.array(color))


filters()
films()
