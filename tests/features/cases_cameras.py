# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Cameras: the share of each pixel that a lamp covers, by projecting its corners."""
import math

import numpy as np

import closed_forms as cf
from scenes import case, film, gray, lamp, polygon, rectangle, scene, window, LOOK

PI = math.pi
QUAD = [(-.7, -.4, .5), (.9, -.6, 0), (.6, .8, -.3), (-.5, .5, .2)]


def planar(points):
    """The last corner moved along z into the plane of the others."""
    a, b, c, d = (np.array(p, dtype=float) for p in points)
    n = np.cross(b - a, c - a)
    d[2] = a[2] - (n[0] * (d[0] - a[0]) + n[1] * (d[1] - a[1])) / n[2]
    return [tuple(p) for p in (a, b, c, d)]


QUAD = planar(QUAD)


def raster(points, camera_from_world, screen, width, height, perspective):
    """screen: x0 x1 y0 y1 at distance 1, or of the image of parallel rays."""
    found = []
    for p in points:
        q = cf.apply(camera_from_world, p)
        x, y = (q[0] / q[2], q[1] / q[2]) if perspective else (q[0], q[1])
        found.append(((x - screen[0]) / (screen[1] - screen[0]) * width,
                      (screen[3] - y) / (screen[3] - screen[2]) * height))
    return found


def seen(name, camera, screen, eye=((0, 0, -5), (0, 0, 0), (0, 1, 0)), size=(8, 8),
         perspective=True,
         points=None, more="", crop=None):
    points = points or QUAD
    width, height = size
    numbers = "  ".join(" ".join(str(c) for c in v) for v in eye)
    corners = raster(points, cf.look_at(*eye), screen, width, height, perspective)
    want = cf.coverage(corners, width, height)
    case("camera " + name,
         scene(polygon(points), camera=f"LookAt {numbers}\n{camera}\n",
               films=film(width, height, more), samples=2048),
         want if crop is None else want[crop])


def screen_of(fov, aspect=1.0):
    t = math.tan(math.radians(fov / 2))
    return ((-t * aspect, t * aspect, -t, t) if aspect > 1
            else (-t, t, -t / aspect, t / aspect))


def perspective():
    for fov in (20, 25, 35):
        seen(f"fov {fov}", f'Camera "perspective" "float fov" {fov}', screen_of(fov))
    seen("default fov", 'Camera "perspective"', screen_of(90),
         eye=((0, 0, -1.7), (0, 0, 0), (0, 1, 0)))
    seen("fov of the shorter side, wide", 'Camera "perspective" "float fov" 22', screen_of(22, 2),
         size=(16, 8))
    seen("fov of the shorter side, high", 'Camera "perspective" "float fov" 22', screen_of(22, .5),
         size=(8, 16))
    seen("frameaspectratio", 'Camera "perspective" "float fov" 22 "float frameaspectratio" 1.5',
         screen_of(22, 1.5))
    t = math.tan(math.radians(15))
    seen("screenwindow", 'Camera "perspective" "float fov" 30 "float screenwindow" [-.5 1 -1 .25]',
         (-.5 * t, t, -t, .25 * t))
    for name, eye in (("from the right", ((3, 1, -4), (0, 0, 0), (0, 1, 0))),
                      ("tilted", ((0, 0, -5), (0, 0, 0), (1, 2, 0))),
                      ("from above", ((.5, 5, -1), (0, 0, 0), (0, 0, 1))),
                      ("from behind", ((1, 1, 5), (.1, 0, 0), (0, 1, 0))),
                      ("past the middle", ((0, 0, -5), (.3, .2, 0), (0, 1, .3)))):
        seen(name, 'Camera "perspective" "float fov" 25', screen_of(25), eye=eye)
    pinhole = 'Camera "perspective" "float fov" 25'
    seen("cropwindow", pinhole, screen_of(25), more='"float cropwindow" [.25 .75 .5 1]',
         crop=np.s_[4:8, 2:6])
    seen("pixelbounds", pinhole, screen_of(25), more='"integer pixelbounds" [1 7 2 6]',
         crop=np.s_[2:6, 1:7])
    seen("resolution", pinhole, screen_of(25, 12 / 10), size=(12, 10))


def orthographic():
    more = {"perspective": False}
    seen("orthographic", 'Camera "orthographic"', (-1, 1, -1, 1), **more)
    seen("orthographic, wide", 'Camera "orthographic"', (-2, 2, -1, 1), size=(16, 8), **more)
    seen("orthographic, high", 'Camera "orthographic"', (-1, 1, -2, 2), size=(8, 16), **more)
    seen("orthographic screenwindow", 'Camera "orthographic" "float screenwindow" [-.5 1 -1 .5]',
         (-.5, 1, -1, .5), **more)
    seen("orthographic frameaspectratio", 'Camera "orthographic" "float frameaspectratio" 2',
         (-2, 2, -1, 1), **more)
    seen("orthographic from the right", 'Camera "orthographic"', (-1, 1, -1, 1),
         eye=((3, 1, -4), (0, 0, 0), (0, 1, 0)), **more)
    case("camera orthographic under a scale",
         scene(lamp(rectangle(-.5, .5, -.5, .5)), camera="Scale 2 2 2\n" + LOOK + window(1)),
         cf.coverage([(0, 0), (8, 0), (8, 8), (0, 8)], 8, 8))


def spherical():
    """A square far away, seen in the directions that the mapping says."""
    def found(mapping, want_of, name, **more):
        grid = (np.arange(64) + .5) / 8
        x, y = np.meshgrid(grid / 8, grid / 8)
        d = want_of(x, y)
        t = 1 / np.maximum(d[..., 2], 1e-9)
        hit = (np.abs(d[..., 0] * t - .5) < 1.3) & (np.abs(d[..., 1] * t - .3) < .9)
        want = hit.reshape(8, 8, 8, 8).mean(axis=(1, 3))
        case(name, scene(lamp(rectangle(-.8, 1.8, -.6, 1.2, 1)),
                         camera=f'LookAt 0 0 0  0 0 1  0 1 0\nCamera "spherical" {mapping}\n',
                         samples=1024, **more), want.mean() * np.ones(3))

    def equirectangular(x, y):
        # pbrt-v4: theta = pi y, phi = 2 pi x about z, then y and z change places.
        theta, phi = PI * y, 2 * PI * x
        return np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)],
                        -1)

    def equal_area(x, y):
        u, v = 2 * x - 1, 2 * y - 1
        s = 1 - (np.abs(u) + np.abs(v))
        r = 1 - np.abs(s)
        phi = np.where(r == 0, 0, (np.abs(v) - np.abs(u)) / np.where(r == 0, 1, r) + 1) * PI / 4
        z = np.sign(s) * (1 - r * r)
        k = r * np.sqrt(np.maximum(2 - r * r, 0))
        d = np.stack([np.sign(u) * np.cos(phi) * k, np.sign(v) * np.sin(phi) * k, z], -1)
        return d[..., [0, 2, 1]]

    found('"string mapping" "equirectangular"', equirectangular, "camera spherical equirectangular")
    found('"string mapping" "equalarea"', equal_area, "camera spherical equalarea")
    # Rows of equal heights of the sphere's angle: the sky above a latitude.
    sky = lamp('Translate 0 1 0 Rotate 90 1 0 0 Shape "disk" "float radius" 1',
               '"rgb L" [1 1 1] "bool twosided" true')
    rows = np.clip(2 - np.arange(8), 0, 1)[:, None] * np.ones((8, 8))
    case("camera spherical rows", scene(sky, camera='LookAt 0 0 0  0 0 1  0 1 0\n'
         'Camera "spherical" "string mapping" "equirectangular"\n'), rows)


def lenses():
    def blurred(name, kind, radius, focus, lamp_radius, distance, share):
        case(f"camera {kind} {name}",
             scene(lamp(f'Translate 0 0 {distance - 5}\nShape "disk" "float radius" {lamp_radius}',
                        '"rgb L" [1 1 1] "bool twosided" true'),
                   camera=LOOK + f'Camera "{kind}" "float screenwindow" [-1e-4 1e-4 -1e-4 1e-4] '
                   f'"float lensradius" {radius} "float focaldistance" {focus}\n', samples=1024),
             gray(min(share, 1)))

    for kind in ("perspective", "orthographic"):
        # Rays from p on the lens to the focus pass the lamp at p (1 - distance / focus).
        for radius, focus, lamp_radius, distance in ((.5, 4, .1, 4), (.5, 4, .1, 6), (.5, 4, .1, 3),
                                                     (1, 10, .3, 5), (.2, 2, .1, 5)):
            share = (lamp_radius / max(radius * abs(1 - distance / focus), 1e-9)) ** 2
            blurred(f"lens of {radius} focused at {focus}, lamp at {distance}", kind, radius, focus,
                    lamp_radius, distance, share)


def shutter():
    """A lamp of width 1 moves by 2 to the right while time goes from 0 to 1."""
    body = ('ActiveTransform EndTime\nTranslate 2 0 0\nActiveTransform All\n'
            + rectangle(-2, -1, -1, 1))
    glow = ('AttributeBegin\nMaterial "diffuse" "spectrum reflectance" [300 1 900 1]\n' + body +
            "AttributeEnd\n")
    light = ('LightSource "distant" "point3 from" [0 0 -1] "point3 to" [0 0 0] '
             f'"float scale" {PI}\n')

    def blur(opens, closes):
        x = (np.arange(8 * 64) + .5) / 256 - 1
        times = opens + (closes - opens) * (np.arange(4999) + .5) / 4999
        left = -2 + 2 * np.clip(times, 0, 1)
        hit = (x[:, None] > left) & (x[:, None] < left + 1)
        return np.tile(hit.mean(axis=1).reshape(8, 64).mean(axis=1), (8, 1))

    for name, opens, closes in (("0 to 1", 0, 1), ("0 to .5", 0, .5), (".5 to 1", .5, 1),
                                ("at .25", .25, .25), ("0 to 2", 0, 2)):
        case(f"shutter open from {name}",
             scene(light + glow, samples=2048, camera=LOOK + 'Camera "orthographic" '
                   f'"float screenwindow" [-1 1 -1 1] "float shutteropen" {opens} '
                   f'"float shutterclose" {closes}\n'), blur(opens, closes))
    case("TransformTimes", scene(light + glow, samples=2048, before="TransformTimes .5 1.5\n",
                                 camera=LOOK + window(1)), blur(-.5, .5))
    case("a camera that moves", scene(
        lamp(rectangle(-2, -1, -1, 1)), samples=2048,
        camera="ActiveTransform EndTime\nLookAt -2 0 -5  -2 0 0  0 1 0\nActiveTransform StartTime\n"
        "LookAt 0 0 -5  0 0 0  0 1 0\nActiveTransform All\n" + window(1)), blur(0, 1))
    case("an instance that moves", scene(
        light + 'Material "diffuse" "spectrum reflectance" [300 1 900 1]\nObjectBegin "o"\n'
        + rectangle(-2, -1, -1, 1) + 'ObjectEnd\nActiveTransform EndTime\nTranslate 2 0 0\n'
        'ActiveTransform All\nObjectInstance "o"', samples=2048), blur(0, 1))
    inside = (light + 'Material "diffuse" "spectrum reflectance" [300 1 900 1]\nObjectBegin "o"\n'
              + "{} ObjectEnd\n{}")
    case("motion in an object", scene(inside.format(body, 'ObjectInstance "o"'), samples=2048),
         blur(0, 1))
    still = rectangle(-1, 1, -1, 0) + body
    want = blur(0, 1)
    want[4:] = 1
    case("motion in an object beside a shape at rest",
         scene(inside.format(still, 'ObjectInstance "o"'), samples=2048), want)
    # Twice the width and twice the way: the instance scales both.
    half = (light + 'Material "diffuse" "spectrum reflectance" [300 1 900 1]\nObjectBegin "o"\n'
            'ActiveTransform EndTime\nTranslate 1 0 0\nActiveTransform All\n'
            + rectangle(-1, -.5, -.5, .5) + 'ObjectEnd\nScale 2 2 2\nObjectInstance "o"')
    case("motion in an object under a scale", scene(half, samples=2048), blur(0, 1))
    both = (light + 'Material "diffuse" "spectrum reflectance" [300 1 900 1]\nObjectBegin "o"\n'
            'ActiveTransform EndTime\nTranslate 1.5 0 0\nActiveTransform All\n'
            + rectangle(-2, -1, -1, 1) + 'ObjectEnd\nActiveTransform EndTime\nTranslate .5 0 0\n'
            'ActiveTransform All\nObjectInstance "o"')
    case("motion in an object that moves", scene(both, samples=2048), blur(0, 1))


perspective()
orthographic()
spherical()
lenses()
shutter()
