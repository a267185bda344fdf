#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Cost of each effect in a small scene of its own: the source of the plan's expected costs.

    SHEAF_BIN=build/release/bin tests/bench/effect_cost.py [SECONDS] [--check] [--effects NAME ...]

For every effect, renders a floor and a box under a light, with and without the effect, in turns
(`sheaf plan --measure`), and prints the ratio of times beside the ratio that the plan states
(kTraitNames in worker/render/plan/render_plan.cc). With --check, exits with 1 if the two differ by
more than a quarter of the time of a sample and by more than 4 standard errors.
"""
import argparse
import json
import math
import os
import struct
import subprocess
import sys
import tempfile

SHEAF = os.path.join(os.environ.get("SHEAF_BIN", "build/release/bin"), "sheaf")
ALLOWED, SIGMAS = 0.25, 4

HEAD = """Film "rgb" "integer xresolution" [128] "integer yresolution" [128]
Sampler "zsobol" "integer pixelsamples" [16]
Integrator "path" "integer maxdepth" [5]
LookAt 0 1.5 -4  0 0.5 0  0 1 0
"""
CAMERA = 'Camera "perspective" "float fov" [45]\n'
FLOOR = ('Material "diffuse" "rgb reflectance" [0.6 0.5 0.4]\n'
         'Shape "trianglemesh" "point3 P" [-9 0 -9  -9 0 9  9 0 9  9 0 -9]\n'
         '  "point2 uv" [0 0  0 9  9 9  9 0] "integer indices" [0 1 2 0 2 3]\n')
LAMP = ('AttributeBegin\nAreaLightSource "diffuse" "rgb L" [9 8 7]\n'
        'Shape "trianglemesh" "point3 P" [-1 3 -1  1 3 -1  1 3 1  -1 3 1]\n'
        '  "integer indices" [0 1 2 0 2 3]\nAttributeEnd\n')
DIFFUSE = 'Material "diffuse" "rgb reflectance" [0.5 0.5 0.5]\n'
P = "[-.6 .1 -.6 .6 .1 -.6 -.6 1.3 -.6 .6 1.3 -.6 -.6 .1 .6 .6 .1 .6 -.6 1.3 .6 .6 1.3 .6]"
I = ("[0 2 3 0 3 1 4 5 7 4 7 6 0 1 5 0 5 4 2 6 7 2 7 3 0 4 6 0 6 2 1 3 7 1 7 5]")
BOX = 'Shape "trianglemesh" "point3 P" %s "integer indices" %s\n' % (P, I)


def boxed(material):
    return CAMERA + "WorldBegin\n" + FLOOR + LAMP + material + BOX


def hazed(medium):
    return ('MakeNamedMedium "haze" "string type" "homogeneous" ' + medium +
            '\nMediumInterface "" "haze"\n' + boxed(DIFFUSE))


UNEVEN = ('WorldBegin\nMakeNamedMedium "haze" "string type" "uniformgrid" "integer nx" [2]\n'
          '"integer ny" [2] "integer nz" [2] "float density" [0 .5 1 1.5 2 1 .5 0]\n'
          '"point3 p0" [-2 0 -2] "point3 p1" [2 3 2]\n'
          '"rgb sigma_a" [.05 .05 .05] "rgb sigma_s" [.2 .2 .2]\n'
          'AttributeBegin\nMaterial "interface"\nMediumInterface "haze" ""\nTranslate 0 1.5 0\n'
          'Shape "sphere" "float radius" [1.4]\nAttributeEnd\n')


SCENES = {
    "motion": CAMERA + "WorldBegin\n" + FLOOR + LAMP + DIFFUSE +
              "AttributeBegin\nActiveTransform EndTime\nTranslate 0.5 0 0\nActiveTransform All\n" +
              BOX + "AttributeEnd\n",
    "deformation": CAMERA + "WorldBegin\n" + FLOOR + LAMP + DIFFUSE +
                   BOX.strip() + ' "point3 P1" %s\n' % P.replace("1.3", "1.5"),
    "lens": 'Camera "perspective" "float fov" [45] "float lensradius" [0.1] '
            '"float focaldistance" [4]\nWorldBegin\n' + FLOOR + LAMP + DIFFUSE + BOX,
    "textures": CAMERA + 'WorldBegin\nTexture "checks" "spectrum" "checkerboard" '
                '"rgb tex1" [0.8 0.2 0.1] "rgb tex2" [0.1 0.2 0.8]\n' +
                FLOOR.replace('"rgb reflectance" [0.6 0.5 0.4]', '"texture reflectance" "checks"') +
                LAMP + DIFFUSE + BOX,
    "environment": boxed(DIFFUSE) + 'LightSource "infinite" "rgb L" [0.2 0.3 0.5]\n',
    "delta lights": boxed(DIFFUSE) + 'LightSource "point" "rgb I" [3 3 3] "point3 from" [1 2 -2]\n',
    "area lights": boxed(DIFFUSE),
    "transmission": boxed('Material "dielectric" "float roughness" [0]\n'),
    "layered materials": boxed('Material "coateddiffuse" "float roughness" [0.1]\n'),
    "microfacets": boxed('Material "conductor" "rgb reflectance" [0.9 0.7 0.5] '
                         '"float roughness" [0.1]\n'),
    "alpha and mixes": boxed(DIFFUSE).replace(
        BOX, BOX.strip() + ' "float alpha" [0.5]\n'),
    "instances": CAMERA + "WorldBegin\n" + FLOOR + LAMP + DIFFUSE + 'ObjectBegin "box"\n' + BOX +
                 'ObjectEnd\nObjectInstance "box"\n',
    "quadrics": CAMERA + "WorldBegin\n" + FLOOR + LAMP + DIFFUSE +
                     'AttributeBegin\nTranslate 0 0.7 0\nShape "sphere" "float radius" [0.7]\n'
                     "AttributeEnd\n",
    "hair": CAMERA + "WorldBegin\n" + FLOOR + LAMP + 'Material "hair" "float eumelanin" [1]\n'
            'AttributeBegin\nTranslate 0 0.7 0\nShape "cylinder" "float radius" [0.5] '
            '"float zmin" [-0.6] "float zmax" [0.6]\nAttributeEnd\n',
    "curves": CAMERA + "WorldBegin\n" + FLOOR + LAMP + DIFFUSE +
              'Shape "curve" "point3 P" [-1 0.1 0  -0.5 1.5 0  0.5 0.1 0  1 1.2 0] '
              '"float width" [0.2]\n',
    "normal and bump maps": CAMERA + "WorldBegin\n" + LAMP + FLOOR.replace(
        'Material "diffuse"', 'Material "diffuse" "string normalmap" "image.pfm"') +
        DIFFUSE + BOX,
    "vertex normals": CAMERA + "WorldBegin\n" + FLOOR + LAMP + DIFFUSE +
                      BOX.strip() + ' "normal N" %s\n' % P,
    "textured emission": CAMERA + "WorldBegin\n" + FLOOR + LAMP.replace(
        '"rgb L" [9 8 7]', '"string filename" "image.pfm" "float scale" [9]') + DIFFUSE + BOX,
    "media": hazed('"rgb sigma_a" [0.05 0.05 0.05] "rgb sigma_s" [0.1 0.1 0.1]'),
    "chromatic media": hazed('"rgb sigma_a" [0.02 0.05 0.1] "rgb sigma_s" [0.05 0.1 0.2]'),
    "emissive media": hazed('"rgb sigma_a" [0.05 0.05 0.05] "rgb sigma_s" [0.1 0.1 0.1] '
                           '"rgb Le" [0.2 0.1 0.05]'),
    "heterogeneous media": boxed(DIFFUSE).replace("WorldBegin\n", UNEVEN),
    "moving volumes": boxed(DIFFUSE).replace("WorldBegin\n", UNEVEN.replace(
        '"point3 p0"', '"vector3 velocity" [%s]\n"point3 p0"' % (".2 .1 0 " * 8))),
    "outputs": boxed(DIFFUSE),
    "subsurface": boxed('Material "subsurface" "rgb reflectance" [0.8 0.5 0.3] '
                        '"rgb mfp" [0.05 0.05 0.05]'),
    "nested dielectrics": boxed('Material "dielectric" "integer priority" 1\n'),
    "spectral transport": boxed('Material "dielectric" "spectrum eta" "glass-BK7"\n'),
}


def write_image(folder):
    """Writes 16 x 16 pixels that serve as a normal map and as an image texture."""
    rows = [(0.5 + 0.2 * math.sin(x), 0.5 + 0.2 * math.cos(x * y), 0.9)
            for y in range(16) for x in range(16)]
    with open(os.path.join(folder, "image.pfm"), "wb") as image:
        image.write(b"PF\n16 16\n-1.0\n")
        for pixel in rows:
            image.write(struct.pack("<3f", *pixel))


def measure(name, text, seconds):
    with tempfile.TemporaryDirectory() as folder:
        write_image(folder)
        path = os.path.join(folder, "scene.pbrt")
        with open(path, "w", encoding="utf-8") as scene:
            head = HEAD.replace('"path"', '"volpath"')
            if name == "outputs":
                head = head.replace('"rgb"', '"gbuffer"', 1)
            scene.write(head + text)
        done = subprocess.run([SHEAF, "plan", path, "--json", "--measure", "--measure-seconds",
                               str(seconds)], capture_output=True, text=True, check=False)
        if done.returncode != 0:
            sys.exit("%s: %s" % (name, done.stderr))
    plan = json.loads(done.stdout)
    stated = next(e.get("expected_time_ratio", 0) for e in plan["effects"] if e["name"] == name)
    return stated, next(e for e in plan["measurement"]["effects"] if e["name"] == name)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("seconds", nargs="?", type=float, default=10)
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--effects", nargs="+", choices=list(SCENES))
    arguments = parser.parse_args()
    failed = False
    names = arguments.effects or list(SCENES)
    print("%-20s %-18s %s" % ("effect", "time ratio", "stated"))
    for name in names:
        text = SCENES[name]
        stated, effect = measure(name, text, arguments.seconds)
        if "problem" in effect:
            sys.exit("%s: %s" % (name, effect["problem"]))
        ratio, error = effect["time_ratio"], effect["time_ratio_error"]
        off = abs(ratio - stated) > max(ALLOWED, SIGMAS * error)
        failed |= off
        print("%-20s %6.3f +- %5.3f    %.2f%s" % (name, ratio, error, stated, "  OFF" * off),
              flush=True)
    sys.exit(1 if failed and arguments.check else 0)


if __name__ == "__main__":
    main()
