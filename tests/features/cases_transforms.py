# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Every spelling of a transform moves a lamp as its matrix does."""
import math

import numpy as np

import closed_forms as cf
from scenes import LOOK, case, gray, rectangle, scene, window, write

SQUARE = [(-.4, -.4, 0), (.4, -.4, 0), (.4, .4, 0), (-.4, .4, 0)]
SHAPE = ('AreaLightSource "diffuse" "rgb L" [1 1 1] "bool twosided" true\n'
         + rectangle(-.4, .4, -.4, .4))


def numbers(matrix):
    """As pbrt-v4 writes it: column by column."""
    return " ".join(f"{v:.9g}" for v in np.asarray(matrix).T.ravel())


def moved(name, text, matrix, samples=1024, **more):
    raster = [((p[0] + 1) * 4, (1 - p[1]) * 4) for p in (cf.apply(matrix, q) for q in SQUARE)]
    case("transform " + name, scene(text if "{}" not in text else text.format(SHAPE),
                                    samples=samples, **more), cf.coverage(raster, 8, 8))


def single():
    t, s, r = cf.translate(.3, -.2, .5), cf.scale(1.5, .7, 2), cf.rotate(30, (0, 0, 1))
    skew = np.array([[1, .4, 0, .1], [.2, .8, 0, -.1], [0, 0, 1, 0], [0, 0, 0, 1]])
    everything = t @ s @ r
    for name, text, matrix in (
            ("none", "", np.eye(4)), ("Identity", "Translate 5 5 5\nIdentity", np.eye(4)),
            ("Translate", "Translate .3 -.2 .5", t), ("Scale", "Scale 1.5 .7 2", s),
            ("Scale that mirrors", "Scale -1.5 .7 1", cf.scale(-1.5, .7, 1)),
            ("Rotate about z", "Rotate 30 0 0 1", r), ("Rotate back", "Rotate -75 0 0 1",
                                                       cf.rotate(-75, (0, 0, 1))),
            ("Rotate about x", "Rotate 50 1 0 0", cf.rotate(50, (1, 0, 0))),
            ("Rotate about y", "Rotate 40 0 1 0", cf.rotate(40, (0, 1, 0))),
            ("Rotate about a diagonal", "Rotate 70 1 2 3", cf.rotate(70, (1, 2, 3))),
            ("Rotate about a long axis", "Rotate 70 10 20 30", cf.rotate(70, (1, 2, 3))),
            ("Rotate by more than a turn", "Rotate 400 0 0 1", cf.rotate(40, (0, 0, 1))),
            ("Transform", f"Translate 5 5 5\nTransform [{numbers(t @ r)}]", t @ r),
            ("Transform of a skew", f"Transform [{numbers(skew)}]", skew),
            ("ConcatTransform", f"Translate .3 -.2 .5\nConcatTransform [{numbers(s)}]", t @ s),
            ("ConcatTransform of a skew", f"Rotate 30 0 0 1\nConcatTransform [{numbers(skew)}]",
             r @ skew),
            ("three in a row", "Translate .3 -.2 .5 Scale 1.5 .7 2 Rotate 30 0 0 1", everything),
            ("three in the other order", "Rotate 30 0 0 1 Scale 1.5 .7 2 Translate .3 -.2 .5",
             r @ s @ t),
            ("LookAt", "LookAt .1 .2 0  .1 .2 1  1 2 0",
             cf.look_at((.1, .2, 0), (.1, .2, 1), (1, 2, 0)))):
        moved(name, text + "\n{}", matrix)


def blocks():
    t, r = cf.translate(.3, -.2, 0), cf.rotate(30, (0, 0, 1))
    for name, text, matrix in (
            ("AttributeBegin and End", "Translate .3 -.2 0\nAttributeBegin\nRotate 80 0 0 1\n"
             "AttributeEnd\nRotate 30 0 0 1\n{}", t @ r),
            ("TransformBegin and End", "Translate .3 -.2 0\nTransformBegin\nRotate 80 0 0 1\n"
             "TransformEnd\nRotate 30 0 0 1\n{}", t @ r),
            ("CoordinateSystem", 'Translate .3 -.2 0\nCoordinateSystem "here"\nRotate 80 0 0 1\n'
             'CoordSysTransform "here"\nRotate 30 0 0 1\n{}', t @ r),
            ("CoordSysTransform out of a block", 'AttributeBegin\nTranslate .3 -.2 0\n'
             'CoordinateSystem "here"\nAttributeEnd\nCoordSysTransform "here"\n{}', t),
            ("ActiveTransform All", "ActiveTransform All\nTranslate .3 -.2 0\n{}", t),
            ("ReverseOrientation", "ReverseOrientation\nTranslate .3 -.2 0\n{}", t),
            ("nested blocks",
             "AttributeBegin\nTranslate .3 -.2 0\nAttributeBegin\nRotate 30 0 0 1\n"
             "{}AttributeEnd\nAttributeEnd", t @ r),
            ("camera's own system", 'CoordSysTransform "camera"\nTranslate 0 0 5\n{}', np.eye(4))):
        moved(name, text, matrix)
    file = write("moved.pbrt", "Rotate 30 0 0 1\n" + SHAPE)
    moved("Include", f'Translate .3 -.2 0\nInclude "{file}"', t @ r)
    moved("Import", f'Translate .3 -.2 0\nImport "{file}"', t @ r)
    moved("before the world", "{}", np.eye(4), camera="Translate 0 0 0\n" + LOOK + window(1))
    moved("camera mirrored", "{}", cf.scale(-1, 1, 1) @ np.eye(4),
          camera="Scale -1 1 1\n" + LOOK + window(1))
    moved("camera turned", "{}", cf.rotate(30, (0, 0, 1)),
          camera="Rotate 30 0 0 1\n" + LOOK + window(1))
    moved("camera moved", "{}", cf.translate(.3, .1, 0),
          camera="Translate .3 .1 0\n" + LOOK + window(1))
    moved("Transform before the camera", "{}", r,
          camera=f"Transform [{numbers(cf.translate(0, 0, 5) @ r)}]\n"
          + window(1))


def instances():
    """White squares under a light, because shapes of objects do not shine."""
    sun = ('LightSource "distant" "point3 from" [0 0 -1] "point3 to" [0 0 0] '
           f'"float scale" {math.pi}\nMaterial "diffuse" "rgb reflectance" [1 1 1]\n')
    square = rectangle(-.4, .4, -.4, .4)
    t, r = cf.translate(.3, -.2, 0), cf.rotate(30, (0, 0, 1))
    for name, text, matrix in (
            ("ObjectInstance", f'ObjectBegin "o"\n{square}ObjectEnd\nTranslate .3 -.2 0\n'
             'ObjectInstance "o"', t),
            ("ObjectInstance of a moved object", f'Translate .3 -.2 0\nObjectBegin "o"\n{square}'
             'ObjectEnd\nIdentity\nRotate 30 0 0 1\nObjectInstance "o"', r @ t),
            ("ObjectInstance under the object's CTM", f'Translate .15 -.1 0\nObjectBegin "o"\n'
             f'{square}ObjectEnd\nObjectInstance "o"', cf.translate(.3, -.2, 0)),
            ("ObjectInstance with a transform inside", f'ObjectBegin "o"\nRotate 30 0 0 1\n{square}'
             'ObjectEnd\nTranslate .3 -.2 0\nObjectInstance "o"', t @ r),
            ("ObjectInstance that mirrors", f'ObjectBegin "o"\nTranslate .3 -.2 0\n{square}'
             'ObjectEnd\nScale -1 1 1\nObjectInstance "o"', cf.scale(-1, 1, 1) @ t)):
        moved(name, sun + text.replace("{}", ""), matrix)
    case("transform ObjectInstance twice", scene(
        f'{sun}ObjectBegin "o"\n{rectangle(-.25, .25, -1, 1)}ObjectEnd\nAttributeBegin\n'
        'Translate -.5 0 0\nObjectInstance "o"\nAttributeEnd\nTranslate .5 0 0\n'
        'ObjectInstance "o"'), np.tile([0, 1, 1, 0, 0, 1, 1, 0], (8, 1)))
    case("transform of an object that is not placed", scene(
        f'{sun}ObjectBegin "o"\n{square}ObjectEnd'), gray(0))


single()
blocks()
instances()
