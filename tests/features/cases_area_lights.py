# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Lights that are shapes: what is seen of them, and the irradiance of a plate before them."""
import math

import numpy as np

import closed_forms as cf
from scenes import case, gray, image, lamp, plate, rectangle, scene

PI = math.pi
SQUARE = rectangle(more="")  # Its area is 4; it shines towards the camera.
DOWN = "Rotate 180 0 1 0\n"  # Its front turns to +z.


def seen(name, light, want, shape=SQUARE, **more):
    case("area light " + name, scene(lamp(shape, light), **more), want)


def radiance():
    seen("default L", "", gray(1))
    seen("L", '"rgb L" [.5 2 3]', (.5, 2, 3))
    seen("scale", '"float scale" 3', gray(3))
    seen("L and scale", '"rgb L" [.5 2 3] "float scale" 2', (1, 4, 6))
    seen("blackbody L", '"blackbody L" 3000', cf.rgb_of_light(cf.planck(3000)))
    seen("blackbody L and scale", '"blackbody L" 8000 "float scale" 2',
         2 * cf.rgb_of_light(cf.planck(8000)))
    seen("spectrum L", '"spectrum L" [360 7 830 7]', cf.rgb_of_light(lambda nm: 1))
    seen("power", '"float power" 100 "bool twosided" false', gray(100 / (4 * PI)),
         patch())
    seen("power and scale", '"float power" 100 "float scale" 3', gray(300 / (4 * PI)), patch())
    seen("power of two sides", '"float power" 100 "bool twosided" true', gray(100 / (8 * PI)),
         patch())
    seen("power of a color", '"float power" 100 "rgb L" [2 1 .5]',
         np.array((2, 1, .5)) * 100 / (4 * PI), patch())
    seen("power of a black body", '"float power" 100 "blackbody L" 3000',
         cf.rgb_of_light(cf.planck(3000)) * 100 / (4 * PI), patch())
    seen("power under a scale", '"float power" 100', gray(100 / (4 * 4 * PI)),
         "Scale 2 2 2\n" + patch())
    seen("power of a sphere", '"float power" 100', gray(100 / (4 * PI * 4 * PI)),
         'Shape "sphere" "float radius" 2')
    seen("power of a disk", '"float power" 100', gray(100 / (4 * PI * PI)),
         DOWN + 'Shape "disk" "float radius" 2')
    seen("nothing behind", '"rgb L" [1 1 1]', gray(0), DOWN + SQUARE)
    seen("twosided", '"rgb L" [.5 2 3] "bool twosided" true', (.5, 2, 3), DOWN + SQUARE)
    seen("ReverseOrientation", '"rgb L" [.5 2 3]', (.5, 2, 3),
         DOWN + "ReverseOrientation\n" + SQUARE)
    seen("mirrored", '"rgb L" [.5 2 3]', gray(0), "Scale -1 1 1\nReverseOrientation\n" + SQUARE)
    texels = np.random.default_rng(1).uniform(.2, 2, (4, 4, 3))
    file = image("lamp.exr", texels)
    seen("image", f'"string filename" "{file}"', texels.mean(axis=(0, 1)))
    seen("image and scale", f'"string filename" "{file}" "float scale" 2',
         2 * texels.mean(axis=(0, 1)))
    flat = image("flat_lamp.exr", np.full((4, 4, 3), .25))
    seen("image and power", f'"string filename" "{flat}" "float power" 100',
         gray(100 / (4 * PI)), patch())
    seen("alpha", '"rgb L" [2 2 2]', gray(1), rectangle(more='"float alpha" .5'), samples=1024)
    seen("of alpha 0", '"rgb L" [2 2 2]', gray(0), rectangle(more='"float alpha" 0'))


def patch():
    return 'Shape "bilinearmesh" "point3 P" [-1 -1 0 -1 1 0 1 -1 0 1 1 0]'


def corner(x, y):
    """View factor of a rectangle of sides x and y with a corner before the point, at 1."""
    p, q = math.hypot(1, x), math.hypot(1, y)
    return (x / p * math.atan(y / p) + y / q * math.atan(x / q)) / (2 * PI)


def lighting():
    more = {"samples": 128}

    def lit(name, shape, irradiance, light='"rgb L" [4 2 1]'):
        case("area light before a plate: " + name, plate(lamp(shape, light), **more),
             np.array((4, 2, 1)) * irradiance / (2 * PI))

    # The lamp is above the plate's middle; the camera looks past it.
    away = "Rotate 180 0 1 0\n"
    lit("square", away + rectangle(-1, 1, -1, 1, 2, '"float alpha" 0'), 4 * corner(.5, .5) * PI)
    lit("rectangle to one side", away + rectangle(-3, -1, 0, 2, 2, '"float alpha" 0'),
        (corner(1.5, 1) - corner(.5, 1)) * PI)
    lit("two sides", rectangle(-1, 1, -1, 1, -2, '"float alpha" 0'), 4 * corner(.5, .5) * PI,
        '"rgb L" [4 2 1] "bool twosided" true')
    for radius, height in ((1, 2), (2, 1)):
        lit(f"disk of {radius} at {height}",
            f'Shape "disk" "float radius" {radius} "float height" {-height} "float alpha" 0',
            PI * radius ** 2 / (radius ** 2 + height ** 2))
    lit("ring", 'Shape "disk" "float radius" 2 "float innerradius" 1 "float height" -2 '
        '"float alpha" 0', PI * (4 / 8 - 1 / 5))
    for x, z in ((0, -2), (2, -2), (3, -1.5)):
        d2 = x * x + z * z
        lit(f"sphere at {x} {z}", f'Translate {x} 0 {z}\nShape "sphere" "float alpha" 0',
            PI / d2 * -z / math.sqrt(d2))
    lit("half a sphere", 'Translate 0 0 -2\nShape "sphere" "float zmin" 0 "float alpha" 0', PI / 4)
    lit("sphere under a uniform scale", 'Translate 0 0 -4\nScale 2 2 2\nShape "sphere" '
        '"float alpha" 0', PI / 4)
    # A closed cylinder would shine as its lid and wall; the wall alone is their difference.
    lit("wall of a cylinder", 'Translate 0 0 -1\nReverseOrientation\nShape "cylinder" '
        '"float zmin" -1 "float zmax" 0 "float alpha" 0', PI * (1 / 2 - 1 / 5))


radiance()
lighting()
