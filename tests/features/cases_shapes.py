# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Shapes: their silhouettes, depths and normals."""
import math

import numpy as np

import closed_forms as cf
from scenes import (LOOK, SUN, case, film, gray, image, lamp, rectangle, scene, window, write)

PI = math.pi
WHITE = SUN + 'Material "diffuse" "rgb reflectance" [1 1 1]\n'
MIRRORED = 'LightSource "infinite"\nMaterial "diffuse" "rgb reflectance" [1 1 1]\n'


def share(name, shape, area, half=1.5, samples=1024, before=""):
    """The part of the window that the shape covers, before a bright ground."""
    black = 'Material "diffuse" "rgb reflectance" [0 0 0]\n'
    case("shape " + name, scene(
        before + lamp(rectangle(-9, 9, -9, 9, 9)) + black + shape, samples=samples,
        camera=LOOK + window(half)), gray(1 - area / (2 * half) ** 2))


def quadrics():
    sphere = 'Shape "sphere" '
    share("sphere", sphere, PI)
    share("sphere of radius .5", sphere + '"float radius" .5', PI / 4)
    # From the side: the silhouette between two heights.
    cap = PI - (math.acos(.5) - .5 * math.sqrt(.75))
    up = "Rotate -90 1 0 0\n"
    share("sphere of zmax .5", up + sphere + '"float zmax" .5', cap)
    share("sphere of zmin -.5", up + sphere + '"float zmin" -.5', cap)
    share("sphere of zmin and zmax", up + sphere + '"float zmin" -.5 "float zmax" .5',
          2 * cap - PI)
    share("sphere of phimax 180", sphere + '"float phimax" 180', PI / 2)
    share("sphere of phimax 90", sphere + '"float phimax" 90', PI / 4)
    share("sphere of zmax 0 from above", sphere + '"float zmax" 0', PI)
    share("sphere stretched", "Scale 1.4 .5 1\n" + sphere, PI * 1.4 * .5)
    share("sphere skewed", "ConcatTransform [1 .3 0 0 .5 1 0 0 0 0 1 0 0 0 0 1]\n" + sphere,
          PI * .85)
    disk = 'Shape "disk" '
    share("disk", disk, PI)
    share("disk of radius .7", disk + '"float radius" .7', PI * .49)
    share("disk with a hole", disk + '"float innerradius" .6', PI * .64)
    share("disk of phimax 120", disk + '"float phimax" 120', PI / 3)
    share("disk turned by 60 degrees", "Rotate 60 0 1 0\n" + disk, PI / 2)
    share("disk at a height, turned", "Rotate 90 0 1 0\nRotate 60 0 1 0\n" + disk +
          '"float height" .4', PI * math.sin(math.radians(60)))
    cylinder = 'Shape "cylinder" '
    share("cylinder", up + cylinder, 4)
    share("cylinder of radius .5", up + cylinder + '"float radius" .5', 2)
    share("cylinder of zmin and zmax", up + cylinder + '"float zmin" -.25 "float zmax" .5', 1.5)
    share("cylinder of phimax 180", up + cylinder + '"float phimax" 180', 4)
    share("cylinder of phimax 90", up + cylinder + '"float phimax" 90', 2)
    share("cylinder from above", cylinder, 0)


def meshes():
    triangle = '"point3 P" [-1 -1 0  1 -1 0  0 1 0]'
    share("trianglemesh", f'Shape "trianglemesh" {triangle} "integer indices" [0 1 2]', 2)
    share("trianglemesh of one triangle without indices", f'Shape "trianglemesh" {triangle}', 2)
    share("trianglemesh of two", 'Shape "trianglemesh" "point3 P" [-1 -1 0 1 -1 0 1 1 0 -1 1 0] '
          '"integer indices" [0 1 2 2 3 0]', 4)
    share("bilinearmesh", 'Shape "bilinearmesh" "point3 P" [-1 -1 0 1 -1 0 -1 1 0 1 1 0]', 4)
    share("bilinearmesh of two",
          'Shape "bilinearmesh" "point3 P" [-1 -1 0 0 -1 0 1 -1 0 -1 1 0 0 1 0 '
          '1 .5 0] "integer indices" [0 1 3 4 1 2 4 5]', 3.75)
    share("bilinearmesh that is twisted",
          'Shape "bilinearmesh" "point3 P" [-1 -1 -.5 1 -1 .5 -1 1 .5 '
          '1 1 -.5]', 4)
    share("bilinearmesh with a corner inside",
          'Shape "bilinearmesh" "point3 P" [-1 -1 0 1 -1 0 -1 1 '
          '0 .5 .5 0]', 3)
    # Every vertex of a regular triangle's boundary moves; the limit is a cubic B-spline.
    share("loopsubdiv of a plane", 'Shape "loopsubdiv" "point3 P" [-1 -1 0 1 -1 0 1 1 0 -1 1 0] '
          '"integer indices" [0 1 2 0 2 3] "integer levels" 5', spline_area(
              [(-1, -1), (1, -1), (1, 1), (-1, 1)]))
    head = ("ply\nformat {}\nelement vertex 4\nproperty float x\nproperty float y\nproperty float "
            "z\n"
            "element face {}\nproperty list uchar int vertex_indices\nend_header\n")
    points = [(-1, -1, 0), (1, -1, 0), (1, .5, 0), (-1, 1, 0)]
    text = "".join(f"{x} {y} {z}\n" for x, y, z in points)
    quad = write("quad.ply", head.format("ascii 1.0", 1) + text + "4 0 1 2 3\n")
    share("plymesh of a quadrilateral", f'Shape "plymesh" "string filename" "{quad}"', 3.5)
    two = write("two.ply", head.format("ascii 1.0", 2) + text + "3 0 1 2\n3 0 2 3\n")
    share("plymesh of triangles", f'Shape "plymesh" "string filename" "{two}"', 3.5)
    for order, sign in (("little", "<"), ("big", ">")):
        data = (head.format(f"binary_{order}_endian 1.0", 1).encode()
                + np.array(points, dtype=sign + "f4").tobytes() + b"\x04"
                + np.arange(4, dtype=sign + "i4").tobytes())
        name = f"{order}.ply"
        path = write(name, "")
        import scenes  # pylint: disable=import-outside-toplevel
        with open(scenes.os.path.join(scenes.FOLDER, path), "wb") as file:
            file.write(data)
        share(f"plymesh, {order} endian", f'Shape "plymesh" "string filename" "{name}"', 3.5)


def spline_area(corners):
    """Area inside the closed limit of Loop's boundary rule, which is a uniform cubic B-spline."""
    for _ in range(8):
        n = len(corners)
        corners = [q for i in range(n) for q in (
            tuple(np.array(corners[i]) * .75 + np.array(corners[i - 1]) / 8 +
                  np.array(corners[(i + 1) % n]) / 8),
            tuple((np.array(corners[i]) + corners[(i + 1) % n]) / 2))]
    return cf.area(corners)


def curves():
    line = '"point3 P" [-1 0 0 -.5 0 0 .5 0 0 1 0 0]'
    for kind in ("flat", "cylinder"):
        share(f"curve, {kind}", f'Shape "curve" "string type" "{kind}" {line} "float width" .4', .8)
    share("curve, ribbon", f'Shape "curve" "string type" "ribbon" {line} "float width" .4 '
          '"normal N" [0 0 1 0 0 1]', .8)
    t = math.radians(60)
    share("curve, ribbon turned by 60 degrees", f'Shape "curve" "string type" "ribbon" {line} '
          f'"float width" .4 "normal N" [0 {math.sin(t)} {math.cos(t)} 0 {math.sin(t)} '
          f'{math.cos(t)}]',
          .8 * math.cos(t))
    share("curve, tapered", f'Shape "curve" {line} "float width0" .6 "float width1" .2', .8)
    share("curve of degree 2", 'Shape "curve" "integer degree" 2 "point3 P" [-1 0 0 0 0 0 1 0 0] '
          '"float width" .4', .8)
    share("curve of a b-spline",
          'Shape "curve" "string basis" "bspline" "point3 P" [-3 0 0 -1 0 0 1 0 '
          '0 3 0 0] "float width" .4', .8)
    share("curve of two segments",
          'Shape "curve" "point3 P" [-1 0 0 -.7 0 0 -.3 0 0 0 0 0 .3 0 0 .7 0 0 '
          '1 0 0] "float width" .4', .8)
    # A thin curve along a parabola covers its length times its width.
    s = np.linspace(0, 1, 20001)
    x, y = 2 * s - 1, 2 * s * (1 - s)
    share("curve that bends", 'Shape "curve" "integer degree" 2 "point3 P" [-1 0 0 0 1 0 1 0 0] '
          '"float width" .1', .1 * np.hypot(np.diff(x), np.diff(y)).sum())


def cutouts():
    white = WHITE + "{}"
    for alpha in (0, .3, .5, 1):
        case(f"shape of alpha {alpha}",
             scene(white.format(rectangle(more=f'"float alpha" {alpha}')),
                                              samples=1024), gray(alpha))
    lamps = lamp(rectangle(-2, 2, -2, 2, 1)) + 'Material "diffuse" "rgb reflectance" [0 0 0]\n'
    for count in (2, 4):
        case(f"shapes of alpha .5, {count} in a row", scene(
            lamps + "".join(rectangle(z=.1 * i, more='"float alpha" .5') for i in range(count)),
            samples=1024), gray(.5 ** count))
    mask = image("mask.exr", np.array([[1, 0, 1, 0]] * 4)[:, :, None])
    case("shape cut out by a texture", scene(
        WHITE + f'Texture "m" "float" "imagemap" "string filename" "{mask}" "string filter" '
                f'"point"\n'
        + rectangle(more='"texture alpha" "m"')), np.tile([1, 1, 0, 0, 1, 1, 0, 0], (8, 1)))
    case("shape alpha by Attribute", scene(
        WHITE + 'Attribute "shape" "float alpha" .25\n' + rectangle(), samples=1024), gray(.25))
    for axis, angle in (("1 0 0", 0), ("0 1 0", 50)):
        case(f"shape displaced, turned by {angle}", scene(
            lamp(rectangle(-9, 9, -9, 9, 9)) + 'Material "diffuse" "rgb reflectance" [0 0 0]\n'
            f'Rotate {angle} {axis}\nTexture "h" "float" "constant" "float value" .5\n'
            + rectangle(-.5, .5, -.5, .5, more='"texture displacement" "h"'), samples=1024),
             cf.coverage([((a + 1) * 4, (1 - b) * 4) for a, b in (
                 ((c * math.cos(math.radians(angle)) - .5 * math.sin(math.radians(angle))), d)
                 for c, d in ((-.5, -.5), (.5, -.5), (.5, .5), (-.5, .5)))], 8, 8) * -1 + 1)


def intersections():
    """The depth and the normal of the middle; normals point to a surface's own front."""
    def of(name, shape, depth, normal=(0, 0, -1), camera=LOOK + window(1e-3)):
        text = scene(MIRRORED + shape, camera=camera, films=film(1, 1))
        case(f"depth of {name}", text, [depth], layer="depth")
        case(f"normal of {name}", text, normal, layer="normal")

    of("a plane", rectangle(), 5)
    of("a plane at an angle", "Rotate 30 0 1 0\n" + rectangle(), 5,
       (-math.sin(math.radians(30)), 0, -math.cos(math.radians(30))))
    of("a sphere", 'Shape "sphere"', 4)
    x = .6
    of("a sphere beside its middle", f'Translate {x} 0 0\nShape "sphere"', 5 - .8, (-x, 0, -.8))
    of("a sphere from inside", 'Shape "sphere" "float zmin" -.5', 6, (0, 0, 1))
    of("a disk", 'Shape "disk" "float height" -.25', 4.75, (0, 0, 1))
    of("a cylinder", 'Rotate 90 1 0 0\nShape "cylinder" "float radius" .75', 4.25)
    of("a cylinder beside its middle", f'Translate {x} 0 0\nRotate 90 1 0 0\nShape "cylinder"',
       4.2, (-x, 0, -.8))
    of("a saddle", 'Shape "bilinearmesh" "point3 P" [-1 -1 -1 1 -1 1 -1 1 1 1 1 -1]', 5, (0, 0, 1))
    # z = -x y here.
    n = cf.normalize((.4, .5, 1))
    of("a saddle beside its middle",
       'Translate -.5 -.4 0\nShape "bilinearmesh" "point3 P" [-1 -1 -1 '
       '1 -1 1 -1 1 1 1 1 -1]', 5 - .2, n)
    of("a plane with normals", 'Shape "trianglemesh" "point3 P" [-1 -1 0 -1 1 0 1 1 0 1 -1 0] '
       '"integer indices" [0 1 2 0 2 3] "normal N" [.3 0 -1 .3 0 -1 .3 0 -1 .3 0 -1]', 5,
       cf.normalize((.3, 0, -1)))


quadrics()
meshes()
curves()
cutouts()
intersections()
