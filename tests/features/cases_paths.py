# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Integrators, samplers and options: their parameters, and that they do not change the mean."""
import math

import numpy as np

from scenes import BLACK, LOOK, case, gray, lamp, rectangle, scene, window

# Inside a ball that shines and reflects a half, light is a geometric series.
BALL = ('Material "diffuse" "rgb reflectance" [.5 .5 .5]\nReverseOrientation\n'
        + lamp('Shape "sphere"'))
INSIDE = "LookAt 0 0 0  0 0 1  0 1 0\n" + 'Camera "perspective" "float fov" 60\n'


def ball(name, integrator, depth, samples=256, before=""):
    case(name, scene(BALL, camera=INSIDE, integrator=integrator, samples=samples, before=before),
         gray(2 - .5 ** depth))


def depths():
    for kind in ("path", "volpath", "simplepath", "simplevolpath", "bdpt", "mlt", "randomwalk"):
        for depth in (0, 1, 3):
            ball(f"integrator {kind}, maxdepth {depth}",
                 f'Integrator "{kind}" "integer maxdepth" {depth}\n', depth)
    ball("integrator path, default maxdepth", 'Integrator "path"\n', 5)
    ball("no integrator", "", 5)
    ball("integrator path, lightsampler power", 'Integrator "path" "string lightsampler" "power" '
         '"integer maxdepth" 2\n', 2)
    ball("integrator path, regularize", 'Integrator "path" "bool regularize" false '
         '"integer maxdepth" 2\n', 2)


def samplers():
    for text in ('"halton"', '"independent"', '"paddedsobol"', '"sobol"', '"zsobol"',
                 '"stratified" "integer xsamples" 16 "integer ysamples" 16',
                 '"sobol" "string randomization" "none"', '"zsobol" "integer seed" 77'):
        more = "" if "stratified" in text else ' "integer pixelsamples" 256'
        case(f"sampler {text.replace(chr(34), '')}", scene(BALL, camera=INSIDE).replace(
            'Sampler "zsobol" "integer pixelsamples" 16', f"Sampler {text}{more}"), gray(1.5))
    for option in ('"bool disablewavelengthjitter" true', '"integer seed" 5', '"seed" 5',
                   '"string rendercoordsys" "world"', '"bool wavefront" true'):
        ball(f"option {option.replace(chr(34), '')}", 'Integrator "path" "integer maxdepth" 1\n', 1,
             before=f"Option {option}\n")
    for kind in ("bvh", "kdtree"):
        ball(f"accelerator {kind}", 'Integrator "path" "integer maxdepth" 1\n', 1,
             before=f'Accelerator "{kind}"\n')


def walls():
    """Two parallel walls: radiance of the one that is lit, and of the one that faces it."""
    sun = ('LightSource "distant" "point3 from" [0 0 -1] "point3 to" [0 0 0] '
           f'"float scale" {math.pi}\nMaterial "diffuse" "rgb reflectance" [.9 .5 .1]\n')
    for depth in (0, 1):
        case(f"direct light, maxdepth {depth}", scene(
            sun + rectangle(), integrator=f'Integrator "path" "integer maxdepth" {depth}\n'),
             np.array((.9, .5, .1)) * depth)
    mirror = ('Material "conductor" "rgb reflectance" [.5 .5 .5]\nAttributeBegin\n'
              'Translate 0 0 0\nReverseOrientation\n' + rectangle(-9, 9, -9, 9) + "AttributeEnd\n")
    for depth, want in ((0, 0), (1, .5), (4, .5)):
        case(f"a lamp in a mirror, maxdepth {depth}", scene(
            mirror + BLACK + lamp("Translate 0 0 -8\nRotate 180 0 1 0\n" + rectangle(-9, 9, -9, 9)),
            camera=LOOK + window(.5), samples=64,
            integrator=f'Integrator "path" "integer maxdepth" {depth}\n'), gray(want))


depths()
samplers()
walls()
