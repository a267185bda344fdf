# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Participating media in slabs: Beer and Lambert, emission, and single scattering."""
import math

import numpy as np

import closed_forms as cf
from scenes import LOOK, case, gray, lamp, rectangle, scene, window

PI = math.pi
# Three voxels along each side, so wide that their values are the same all over the box.
WIDE = '"integer nx" 3 "integer ny" 3 "integer nz" 3 "point3 p0" [-3 -3 -3] "point3 p1" [3 3 3]'
LAMP = lamp(rectangle(-.05, .05, -.05, .05, 4), '"rgb L" [1 1 1]')


def cube(x=1, y=1, z=1):
    """The box from -x to x and so on, with its normals outwards."""
    p = [(i, j, k) for k in (-z, z) for j in (-y, y) for i in (-x, x)]
    faces = "0 2 3 0 3 1  4 5 7 4 7 6  0 1 5 0 5 4  2 6 7 2 7 3  0 4 6 0 6 2  1 3 7 1 7 5"
    return ('Shape "trianglemesh" "point3 P" [' + " ".join(f"{a} {b} {c}" for a, b, c in p)
            + f'] "integer indices" [{faces}]\n')


def medium(kind, text, shape=None, before="", inside='"m" ""'):
    return (f'{before}MakeNamedMedium "m" "string type" "{kind}" {text}\nAttributeBegin\n'
            f'Material "interface"\nMediumInterface {inside}\n{shape or cube()}AttributeEnd\n')


def seen(name, kind, text, want, depth=1, world=None, samples=1024, **more):
    """Through the middle of a box of length 2, towards a small lamp behind it."""
    more.setdefault("camera", LOOK + window(.001))
    case("medium " + name, scene((LAMP if world is None else world) + medium(kind, text),
                                 samples=samples, integrator=f'Integrator "volpath" '
                                 f'"integer maxdepth" {depth}\n', **more), want)


def transmittance():
    for name, text, sigma in (
            ("sigma_a", '"rgb sigma_a" [.5 1 .2] "rgb sigma_s" [0 0 0]', (.5, 1, .2)),
            ("scale", '"rgb sigma_a" [.5 1 .2] "rgb sigma_s" [0 0 0] "float scale" .5',
             (.25, .5, .1)),
            ("sigma_a and sigma_s", '"rgb sigma_a" [.1 .2 .3] "rgb sigma_s" [.3 .2 .1]',
             (.4, .4, .4)),
            ("a preset", '"string preset" "Wholemilk" "float scale" .1',
             np.array((.0011 + 2.55, .0024 + 3.21, .014 + 3.77)) * .1)):
        seen(f"homogeneous, {name}", "homogeneous", text, np.exp(-2 * np.array(sigma)), depth=0)
    points = np.array([.2, .6, 1])
    seen("homogeneous, spectra", "homogeneous", '"spectrum sigma_a" [300 .5 900 .5] '
         '"spectrum sigma_s" [300 0 900 0]', gray(math.exp(-1)), color="spectral")
    box = '"point3 p0" [-1 -1 -1] "point3 p1" [1 1 1] "rgb sigma_s" [0 0 0]'
    seen("uniformgrid of one value", "uniformgrid",
         f'{WIDE} "float density" [{"1 " * 27}] "rgb sigma_a" [.2 .6 1] "rgb sigma_s" [0 0 0]',
         np.exp(-2 * points), depth=0)
    # Voxels in a row along z: density is linear between their middles, and falls to 0 beyond the
    # first and the last.
    for name, density in (("two values", (1, 3)), ("four values", (1, 0, 2, .5))):
        n = len(density)
        at = (np.arange(20000) + .5) / 20000 * n - .5
        padded = np.interp(at, np.arange(-1, n + 1), [0, *density, 0])
        seen(f"uniformgrid of {name}", "uniformgrid",
             f'{box} "integer nx" 1 "integer ny" 1 "integer nz" {n} "float density" '
             f'[{" ".join(map(str, density))}] "rgb sigma_a" [.2 .6 1]',
             np.exp(-2 * padded.mean() * points), depth=0)
    seen("uniformgrid, scale", "uniformgrid",
         f'{box} "integer nx" 1 "integer ny" 1 "integer nz" 2 "float density" [1 1] '
         '"rgb sigma_a" [.2 .6 1] "float scale" .5', np.exp(-.875 * points), depth=0)
    seen("rgbgrid", "rgbgrid", f'{WIDE} "rgb sigma_a" [{".2 .6 1 " * 27}] '
         f'"rgb sigma_s" [{"0 " * 81}]', np.exp(-2 * points), depth=0)
    case("medium ignored by integrator path", scene(
        LAMP + medium("homogeneous", '"rgb sigma_a" [.5 1 .2] "rgb sigma_s" [0 0 0]'),
        camera=LOOK + window(.001), integrator='Integrator "path"\n'), gray(1))
    case("medium of the camera", scene(
        LAMP, camera='MakeNamedMedium "m" "string type" "homogeneous" "rgb sigma_a" [.05 .1 .02] '
        '"rgb sigma_s" [0 0 0]\nMediumInterface "" "m"\n' + LOOK + window(.001), samples=256),
         np.exp(-9 * np.array((.05, .1, .02))))
    case("medium outside of a shape", scene(
        LAMP + medium("homogeneous", '"rgb sigma_a" [.05 .1 .02] "rgb sigma_s" [0 0 0]',
                      inside='"" "m"'),
        camera='MediumInterface "" "m"\n' + LOOK + window(.001)),
         np.exp(-7 * np.array((.05, .1, .02))))
    case("medium between media", scene(
        LAMP + 'MakeNamedMedium "n" "string type" "homogeneous" "rgb sigma_a" [.4 .2 .1] '
        '"rgb sigma_s" [0 0 0]\n' + medium("homogeneous", '"rgb sigma_a" [.1 .2 .3] '
                                         '"rgb sigma_s" [0 0 0]', cube(1.5, 1.5, 1.5))
        + 'Material "interface"\nMediumInterface "n" "m"\n' + cube(.5, .5, .5),
        camera=LOOK + window(.001)), np.exp(-2 * np.array((.1, .2, .3)) - np.array((.4, .2, .1))))
    seen("by Attribute", "homogeneous", '"rgb sigma_a" [.5 1 .2]', np.exp(-np.array((1., 2, .4))),
         world='Attribute "medium" "rgb sigma_s" [0 0 0]\n' + LAMP, depth=0)


def emission():
    """Le sigma_a over the length, less what the medium absorbs again."""
    a = np.array((.5, 1, .2))
    inner = 1 - np.exp(-2 * a)
    text = '"rgb sigma_a" [.5 1 .2] "rgb sigma_s" [0 0 0] '
    for name, more, want in (
            ("Le", '"rgb Le" [1 2 3]', (1, 2, 3)),
            ("Le and Lescale", '"rgb Le" [1 2 3] "float Lescale" 2', (2, 4, 6))):
        seen(f"homogeneous, {name}", "homogeneous", text + more, np.array(want) * inner, world="",
             samples=1024)
    seen("homogeneous, blackbody Le", "homogeneous", '"spectrum sigma_a" [300 .5 900 .5] '
         '"spectrum sigma_s" [300 0 900 0] "blackbody Le" 4000',
         cf.rgb_of_light(cf.planck(4000)) * (1 - math.exp(-1)), world="", samples=1024,
         color="spectral")
    cells = (f'{WIDE} "rgb sigma_a" [{".5 1 .2 " * 27}] "rgb sigma_s" [{"0 " * 81}] '
             f'"rgb Le" [{"1 2 3 " * 27}] ')
    seen("rgbgrid, Le", "rgbgrid", cells, np.array((1, 2, 3)) * inner, world="", samples=1024)
    seen("rgbgrid, Le and Lescale", "rgbgrid", cells + '"float Lescale" .5',
         np.array((1, 2, 3)) * inner / 2, world="", samples=1024)
    ones = f'{WIDE} {text} "float density" [{"1 " * 27}] "rgb Le" [1 2 3] '
    seen("uniformgrid, Le", "uniformgrid", ones, np.array((1, 2, 3)) * inner, world="",
         samples=1024)
    seen("uniformgrid, Le and Lescale", "uniformgrid", ones + f'"float Lescale" [{"2 " * 27}]',
         np.array((2, 4, 6)) * inner, world="", samples=1024)


def scattering():
    """One scattering of a distant light, in a box so long that its ends do not matter."""
    s = .2
    for g in (-.6, 0, .3, .8):
        for name, x, z in (("behind the camera", 0, -1), ("beside", 1, 0),
                           ("before the camera", 0, 1),
                           ("at 45 degrees", 1, -1)):
            w = cf.normalize((x, 0, z))
            # Length that the light has passed at depth t of the box from -1 to 1.
            t = (np.arange(2000) + .5) / 1000
            into = {(0, -1): t, (0, 1): 2 - t, (1, 0): np.ones(2000)}.get(
                (x, z), np.minimum(math.sqrt(2) * t, math.sqrt(2)))
            p = cf.henyey_greenstein(w[2], g)
            want = PI * s * p * (np.exp(-s * (t + into))).mean() * 2
            seen(f"single scattering of g {g}, light {name}", "homogeneous",
                 f'"rgb sigma_a" [0 0 0] "rgb sigma_s" [{s} {s} {s}] "float g" {g}', gray(want),
                 world=f'LightSource "distant" "point3 from" [{w[0]} 0 {w[2]}] "point3 to" [0 0 0] '
                 f'"float scale" {PI}\n', samples=512)
    seen("that absorbs nothing under a sky", "homogeneous", '"rgb sigma_a" [0 0 0] '
         '"rgb sigma_s" [1 2 3] "float g" .4', gray(1), depth=200,
         world='LightSource "infinite" "rgb L" [1 1 1]\n', samples=256)


transmittance()
emission()
scattering()
