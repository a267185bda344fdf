# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Lights without a surface, on a plate that reflects a half: radiance is irradiance / (2 pi)."""
import math

import numpy as np

import closed_forms as cf
from scenes import case, gray, image, plate, scene, rectangle, BLACK, LOOK, window

PI = math.pi
FROM = '"point3 from" [0 0 -2] "point3 to" [0 0 0]'


def lit(name, light, irradiance, **more):
    want = np.array(irradiance, dtype=float) / (2 * PI)
    case(name, plate(light, **more), want if want.ndim else gray(want))


def distant():
    for name, text, value in (
            ("default L", "", 1),
            ("L", '"rgb L" [2 2 2]', 2),
            ("L of a color", '"rgb L" [3 1 .5]', (3, 1, .5)),
            ("scale", '"float scale" 3', 3),
            ("L and scale", '"rgb L" [.5 1 2] "float scale" 4', (2, 4, 8)),
            ("illuminance", '"float illuminance" 7', 7),
            ("illuminance and scale", '"float illuminance" 7 "float scale" 2', 14),
            ("illuminance of a color", '"float illuminance" 2 "rgb L" [1 .5 .25]', (2, 1, .5)),
            ("spectrum L", '"spectrum L" [360 5 830 5]', cf.rgb_of_light(lambda nm: 1))):
        lit("distant " + name, f'LightSource "distant" {FROM} {text}', value)
    for degrees in (20, 50, 70):
        t = math.radians(degrees)
        lit(f"distant at {degrees} degrees",
            f'LightSource "distant" "point3 from" [{math.sin(t)} 0 {-math.cos(t)}] '
            '"point3 to" [0 0 0]', math.cos(t))
    lit("distant default from and to", 'LightSource "distant"', 1)
    lit("distant turned by the CTM",
        f'AttributeBegin Rotate 60 0 1 0 LightSource "distant" {FROM} AttributeEnd', .5)
    lit("distant under a scale", f'AttributeBegin Scale 3 3 3 LightSource "distant" {FROM} '
        'AttributeEnd', 1)


def point():
    at = '"point3 from" [0 0 -2]'
    for name, text, value in (
            ("default I", at, 1 / 4),
            ("I", at + ' "rgb I" [8 8 8]', 2),
            ("I of a color", at + ' "rgb I" [8 4 2]', (2, 1, .5)),
            ("scale", at + ' "float scale" 8', 2),
            ("power", at + ' "float power" 100', 100 / (4 * PI) / 4),
            ("power and scale", at + ' "float power" 100 "float scale" 3', 300 / (4 * PI) / 4),
            ("power of a color", at + ' "float power" 100 "rgb I" [2 1 .5]',
             np.array((2, 1, .5)) * 100 / (4 * PI) / 4),
            ("power of a spectrum", at + ' "float power" 100 "spectrum I" [360 9 830 9]',
             cf.rgb_of_light(lambda nm: 1) * 100 / (4 * PI) / 4),
            ("blackbody I", at + ' "blackbody I" 4000', cf.rgb_of_light(cf.planck(4000)) / 4),
            ("at 5", '"point3 from" [0 0 -5] "float scale" 50', 2),
            ("beside", '"point3 from" [3 0 -4] "float scale" 50', 2 * 4 / 5)):
        lit("point " + name, f'LightSource "point" {text}', value)
    lit("point moved by the CTM",
        'AttributeBegin Translate 0 0 -2 LightSource "point" "float scale" 8 AttributeEnd', 2)
    lit("point moved and scaled",
        'AttributeBegin Scale 2 2 2 LightSource "point" "point3 from" [0 0 -2] "float scale" 8 '
        'AttributeEnd', .5)


def smooth_step(degrees, cone, delta):
    c = math.cos(math.radians(degrees))
    low, high = math.cos(math.radians(cone)), math.cos(math.radians(cone - delta))
    t = min(max((c - low) / (high - low), 0), 1)
    return t * t * (3 - 2 * t)


def spot():
    lit("spot default cone", f'LightSource "spot" {FROM} "float scale" 8', 2)
    lit("spot I", f'LightSource "spot" {FROM} "rgb I" [8 4 2]', (2, 1, .5))
    # The lamp stands above the plate's middle and points away from it by the angle.
    for degrees, cone, delta in ((10, 30, 5), (26, 30, 5), (28, 30, 5), (35, 30, 5), (40, 60, 40),
                                 (50, 60, 40), (30, 40, 40)):
        x = 2 * math.tan(math.radians(degrees))
        lit(f"spot at {degrees} of {cone} - {delta} degrees",
            f'LightSource "spot" "point3 from" [0 0 -2] "point3 to" [{x} 0 0] "float scale" 8 '
            f'"float coneangle" {cone} "float conedeltaangle" {delta}',
            2 * smooth_step(degrees, cone, delta))
    for cone, delta in ((30, 5), (50, 20)):
        low = math.cos(math.radians(cone))
        high = math.cos(math.radians(cone - delta))
        intensity = 100 / (2 * PI * ((1 - high) + (high - low) / 2))
        for scale in (1, 2):
            lit(f"spot power of {cone} - {delta} degrees, scale {scale}",
                f'LightSource "spot" {FROM} "float power" 100 "float scale" {scale} '
                f'"float coneangle" {cone} "float conedeltaangle" {delta}', scale * intensity / 4)
    lit("spot turned by the CTM",
        'AttributeBegin Translate 0 0 -2 LightSource "spot" "float scale" 8 AttributeEnd', 2)


def images_of_lights():
    flat = image("flat.exr", np.full((8, 8, 3), .5))
    halves = image("halves.exr", [[[1, .5, .25]] * 4 + [[.5, .25, 1]] * 4] * 8)
    at = 'Translate 0 0 -2'
    for name, text, value in (
            ("image", f'"string filename" "{flat}"', .5 / 4),
            ("I", f'"string filename" "{flat}" "rgb I" [8 4 2]', np.array((8, 4, 2)) * .5 / 4),
            ("scale", f'"string filename" "{flat}" "float scale" 16', 2),
            ("power", f'"string filename" "{flat}" "float power" 100', 100 / (4 * PI) / 4),
            ("power and scale", f'"string filename" "{flat}" "float power" 100 "float scale" 2',
             200 / (4 * PI) / 4)):
        lit("goniometric " + name,
            f'AttributeBegin {at} LightSource "goniometric" {text} AttributeEnd', value)
    for name, text, value in (
            ("image", f'"string filename" "{flat}"', .5 / 4),
            ("scale", f'"string filename" "{flat}" "float scale" 16', 2),
            ("fov", f'"string filename" "{flat}" "float fov" 20 "float scale" 8', 1)):
        lit("projection " + name,
            f'AttributeBegin {at} LightSource "projection" {text} AttributeEnd', value)
    # x of the image is to the right as seen from the lamp, as in a camera.
    for name, x, want in (("left half", -1, (1, .5, .25)), ("right half", 1, (.5, .25, 1))):
        cosine = 2 / math.sqrt(5)
        case("projection " + name,
             scene(f'AttributeBegin {at} LightSource "projection" "string filename" "{halves}" '
                   f'"float scale" 8 "float fov" 90 AttributeEnd\nMaterial "diffuse" '
                   f'"spectrum reflectance" [300 .5 900 .5]\n{rectangle(-99, 99, -99, 99)}',
                   camera=f"LookAt {x} 0 -5 {x} 0 0 0 1 0\n" + window(.01)),
             np.array(want) * 8 / 5 * cosine / (2 * PI))
    # The power of a square pyramid of a uniform intensity: its solid angle.
    for fov in (30, 90):
        a = math.tan(math.radians(fov / 2))
        solid = 4 * math.asin(a * a / (1 + a * a))
        lit(f"projection power, fov {fov}",
            f'AttributeBegin {at} LightSource "projection" "string filename" "{flat}" '
            f'"float power" 10 "float fov" {fov} AttributeEnd', 10 / solid / 4)


def infinite():
    white = image("white.exr", np.ones((16, 16, 3)))
    color = image("color.exr", np.tile([.5, 1, 2], (16, 16, 1)))
    more = {"samples": 256}
    for name, text, value in (
            ("default L", "", PI),
            ("L", '"rgb L" [.5 1 2]', np.array((.5, 1, 2)) * PI),
            ("scale", '"float scale" 2', 2 * PI),
            ("illuminance", '"float illuminance" 5', 5),
            ("illuminance and scale", '"float illuminance" 5 "float scale" 2', 10),
            ("blackbody L", '"blackbody L" 5000', PI * cf.rgb_of_light(cf.planck(5000))),
            ("image", f'"string filename" "{white}"', PI),
            ("image of a color", f'"string filename" "{color}"', np.array((.5, 1, 2)) * PI),
            ("image and scale", f'"string filename" "{white}" "float scale" 3', 3 * PI)):
        lit("infinite " + name, f'LightSource "infinite" {text}', value, **more)
    # The center of the square is +z of the light; the outer triangles are below.
    st = (np.arange(64) + .5) / 64 * 2 - 1
    side = np.sign(1 - np.abs(st)[:, None] - np.abs(st)[None, :])
    dome = image("dome.exr", np.repeat(side[:, :, None], 3, 2) / 2 + .5)
    for name, turn, want in (("behind the plate", "", 0), ("before the plate", "Rotate 180 0 1 0",
                                                           PI),
                             ("beside the plate", "Rotate 90 0 1 0", PI / 2)):
        lit(f"infinite image of +z {name}", f'AttributeBegin {turn} LightSource "infinite" '
            f'"string filename" "{dome}" AttributeEnd', want, **more)
    lit("infinite image under a uniform scale", 'AttributeBegin Scale 3 3 3 Rotate 90 0 1 0 '
        f'LightSource "infinite" "string filename" "{dome}" AttributeEnd', PI / 2, **more)
    # A direction w looks up (w.x / 2, w.y, w.z / 4): the edge at 45 degrees moves.
    lit("infinite image stretched along its edge", 'AttributeBegin Scale 2 1 4 Rotate 90 0 1 0 '
        f'LightSource "infinite" "string filename" "{dome}" AttributeEnd', PI / 2, **more)
    # Lit is the half where w.x / 4 > w.z; half spaces give (1 + cos t) / 2 of the whole, t from the
    # plate's normal to the middle of the half.
    lit("infinite image stretched across its edge", 'AttributeBegin Scale 4 1 1 Rotate 135 0 1 0 '
        f'LightSource "infinite" "string filename" "{dome}" AttributeEnd',
        PI * (1 + 4 / math.sqrt(17)) / 2, **more)
    # The view factor of a square, from a point at half its size before its middle: four corners.
    corner = math.atan(1 / math.sqrt(2)) / math.sqrt(2) / PI
    lit("infinite image through a portal",
        f'LightSource "infinite" "string filename" "{white}" '
        '"point3 portal" [-1 -1 -1 1 -1 -1 1 1 -1 -1 1 -1]', PI * 4 * corner, **more)
    case("infinite image seen directly", scene('LightSource "infinite" "string filename" '
         f'"{color}"', camera=LOOK + 'Camera "perspective" "float fov" 20\n'), (.5, 1, 2))
    case("infinite L seen directly", scene('LightSource "infinite" "rgb L" [.5 1 2]'), (.5, 1, 2))
    case("two lights add up", plate(
        f'LightSource "distant" {FROM}\nLightSource "point" "point3 from" [0 0 -2] '
        f'"rgb I" [8 4 2]'), (np.array((2, 1, .5)) + 1) / (2 * PI))
    case("a black plate", scene(f'LightSource "distant" {FROM}\n{BLACK}{rectangle()}'), gray(0))


distant()
point()
spot()
images_of_lights()
infinite()
