# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Textures, seen on a plate whose radiance is their value."""
import math

import numpy as np

from noise_forms import dots, fbm, lattice_noise, marble, turbulence
from scenes import (SUN, case, gray, image, rectangle, scene, srgb_to_linear, write)

PI = math.pi
TEXELS = np.random.default_rng(7).uniform(.1, .9, (4, 4, 3))
FINE = 32  # Points along each side of a pixel, for expected values.


def grid():
    """uv of points in the pixels' order: v is 1 at the top."""
    at = (np.arange(8 * FINE) + .5) / (8 * FINE)
    return np.meshgrid(at, 1 - at)


def means(values):
    """Pixels of values at the points of grid()."""
    return values.reshape(8, FINE, 8, FINE, -1).mean(axis=(1, 3))


def nearest(texels, u, v, wrap="repeat"):
    """Texel at uv; the image's first row is at v = 1."""
    height, width = texels.shape[:2]
    x, y = np.floor(u * width).astype(int), np.floor((1 - v) * height).astype(int)
    if wrap == "repeat":
        return texels[y % height, x % width]
    found = texels[np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)]
    if wrap == "black":
        inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        found = found * inside[..., None]
    return found


def bilinear(texels, u, v, wrap="repeat"):
    height, width = texels.shape[:2]
    x, y = u * width - .5, (1 - v) * height - .5
    x0, y0 = np.floor(x), np.floor(y)
    total = 0
    for dx in (0, 1):
        for dy in (0, 1):
            weight = np.abs(1 - dx - (x - x0)) * np.abs(1 - dy - (y - y0))
            total = total + weight[..., None] * nearest(
                texels, (x0 + dx + .5) / width, 1 - (y0 + dy + .5) / height, wrap)
    return total


def shown(name, texture, want, shape=None, kind="spectrum", **more):
    """texture: what stands after its name and type."""
    more.setdefault("samples", 1024)
    case("texture " + name, scene(
        f'{SUN}Texture "t" "{kind}" {texture}\nMaterial "diffuse" "texture reflectance" "t"\n'
        f'{shape or rectangle()}', **more), want)


def maps():
    u, v = grid()
    file = image("texels.exr", TEXELS)
    head = f'"imagemap" "string filename" "{file}"'
    point = '"string filter" "point"'
    shown("imagemap point", f"{head} {point}", means(nearest(TEXELS, u, v)))
    shown("imagemap default filter", head, means(bilinear(TEXELS, u, v)))
    shown("imagemap bilinear", f'{head} "string filter" "bilinear"', means(bilinear(TEXELS, u, v)))
    for wrap in ("repeat", "clamp", "black"):
        for name, method in (("point", nearest), ("bilinear", bilinear)):
            shown(f"wrap {wrap}, {name}",
                  f'{head} "string filter" "{name}" "string wrap" "{wrap}" "float uscale" 2 '
                  '"float vscale" 3 "float udelta" -.4 "float vdelta" -.8',
                  means(method(TEXELS, 2 * u - .4, 3 * v - .8, wrap)), samples=2048)
    for name, text, map_u, map_v in (
            ("uscale", '"float uscale" 2.5', 2.5 * u, v),
        ("vscale", '"float vscale" .5', u, .5 * v),
            ("udelta", '"float udelta" .3', u + .3, v), ("vdelta", '"float vdelta" .2', u, v + .2),
            ("negative scales", '"float uscale" -1 "float vscale" -2', -u, -2 * v)):
        shown(name, f"{head} {point} {text}", means(nearest(TEXELS, map_u, map_v)))
    shown("scale", f'{head} {point} "float scale" .5', .5 * means(nearest(TEXELS, u, v)))
    shown("invert", f'{head} {point} "bool invert" true', 1 - means(nearest(TEXELS, u, v)))
    shown("invert and scale", f'{head} {point} "bool invert" true "float scale" .5',
          np.maximum(0, 1 - .5 * means(nearest(TEXELS, u, v))))
    shown("scale above 1", f'{head} {point} "float scale" 3',
          means(np.minimum(1, 3 * nearest(TEXELS, u, v))))
    for name in ("trilinear", "ewa"):
        shown(f"{name}, from afar", f'{head} "string filter" "{name}" "float uscale" 64 '
              '"float vscale" 64', TEXELS.mean(axis=(0, 1)))


def files():
    u, v = grid()
    levels = np.round(TEXELS * 255) / 255
    for extension in ("png", "tif", "bmp"):
        file = image("levels." + extension, levels, "uint8")
        shown(f"8 bits in {extension}", f'"imagemap" "string filename" "{file}" "string filter" '
              '"point"', means(nearest(srgb_to_linear(levels), u, v)))
    png = image("coded.png", levels, "uint8")
    for name, encoding, decode in (("sRGB", "sRGB", srgb_to_linear), ("linear", "linear", np.array),
                                   ("gamma 2.2", "gamma 2.2", lambda x: x ** 2.2),
                                   ("gamma 1.4", "gamma 1.4", lambda x: x ** 1.4)):
        shown(f"encoding {name}", f'"imagemap" "string filename" "{png}" "string filter" "point" '
              f'"string encoding" "{encoding}"', means(nearest(decode(levels), u, v)))
    one = image("gray.png", levels[:, :, :1], "uint8")
    shown("gray png", f'"imagemap" "string filename" "{one}" "string filter" "point"',
          means(nearest(srgb_to_linear(np.repeat(levels[:, :, :1], 3, 2)), u, v)))
    half = image("half.exr", TEXELS, "half")
    shown("half exr", f'"imagemap" "string filename" "{half}" "string filter" "point"',
          means(nearest(TEXELS, u, v)))
    hdr = image("light.hdr", TEXELS)
    shown("hdr", f'"imagemap" "string filename" "{hdr}" "string filter" "point"',
          means(nearest(TEXELS, u, v)))
    alpha = image("opaque.exr", np.concatenate([TEXELS, np.ones((4, 4, 1))], 2))
    shown("exr with an opaque alpha", f'"imagemap" "string filename" "{alpha}" "string filter" '
          '"point"', means(nearest(TEXELS, u, v)))
    wide = image("wide.exr", TEXELS[:2])
    shown("4 by 2", f'"imagemap" "string filename" "{wide}" "string filter" "point"',
          means(nearest(TEXELS[:2], u, v)))


def mappings():
    u, v = grid()
    x, y = 2 * u - 1, 2 * v - 1
    file = image("mapped.exr", TEXELS)
    head = f'"imagemap" "string filename" "{file}" "string filter" "point"'

    def at(s, t):
        return means(nearest(TEXELS, s, t))

    planar = '"string mapping" "planar"'
    shown("mapping uv", f'{head} "string mapping" "uv"', at(u, v))
    shown("mapping planar", f"{head} {planar}", at(x, y))
    shown("mapping planar of v1 and v2", f'{head} {planar} "vector3 v1" [.5 .25 0] '
          '"vector3 v2" [-.25 .75 3]', at(.5 * x + .25 * y, -.25 * x + .75 * y))
    shown("mapping planar of deltas", f'{head} {planar} "float udelta" .3 "float vdelta" .2',
          at(x + .3, y + .2))
    case("texture mapping planar under a CTM", scene(
        f'{SUN}AttributeBegin Translate .2 .1 0 Scale 2 .5 1\nTexture "t" "spectrum" {head} '
        f'{planar}\n'
        'AttributeEnd\nMaterial "diffuse" "texture reflectance" "t"\n' + rectangle(), samples=1024),
         at((x - .2) / 2, (y - .1) / .5))
    # About the texture's own axes, here at z = .8 before the plate.
    z = np.full_like(x, .8)
    r = np.sqrt(x * x + y * y + z * z)
    phi = np.arctan2(y, x)
    phi = np.where(phi < 0, phi + 2 * PI, phi) / (2 * PI)

    def moved(name, kind, s, t):
        case(f"texture mapping {name}", scene(
            f'{SUN}AttributeBegin Translate 0 0 -.8\nTexture "t" "spectrum" {head} '
            f'"string mapping" "{kind}"\nAttributeEnd\nMaterial "diffuse" "texture reflectance" '
            f'"t"\n'
            + rectangle(), samples=256), at(s, t))

    moved("spherical", "spherical", np.arccos(z / r) / PI, phi)
    turned = np.arctan2(y, x)
    moved("cylindrical", "cylindrical", (PI + turned) / (2 * PI), z)


def mixtures():
    u, v = grid()
    red, blue = (.8, .2, .1), (.1, .3, .6)
    both = '"rgb tex1" [.8 .2 .1] "rgb tex2" [.1 .3 .6]'
    shown("constant", '"constant" "rgb value" [.8 .2 .1]', red)
    shown("constant default", '"constant"', gray(1))
    shown("mix default amount", f'"mix" {both}', (np.array(red) + blue) / 2)
    for amount in (0, .25, 1):
        shown(f"mix amount {amount}", f'"mix" {both} "float amount" {amount}',
              np.array(red) * (1 - amount) + np.array(blue) * amount)
    shown("mix of defaults", '"mix"', gray(.5))
    shown("scale of a color", '"scale" "rgb tex" [.8 .2 .1] "float scale" .5', np.array(red) / 2)
    board = f'"checkerboard" {both}'
    for name, text, cells in (
            ("checkerboard", "", np.floor(u) + np.floor(v)),
            ("checkerboard of scales", '"float uscale" 4 "float vscale" 2',
             np.floor(4 * u) + np.floor(2 * v)),
            ("checkerboard of deltas", '"float uscale" 4 "float vscale" 4 "float udelta" .5',
             np.floor(4 * u + .5) + np.floor(4 * v)),
            ("checkerboard of dimension 2",
             '"integer dimension" 2 "float uscale" 2 "float vscale" 2',
             np.floor(2 * u) + np.floor(2 * v)),
            ("checkerboard planar", '"string mapping" "planar" "vector3 v1" [2 0 0] '
             '"vector3 v2" [0 4 0]', np.floor(2 * (2 * u - 1)) + np.floor(4 * (2 * v - 1)))):
        even = (cells % 2 == 0)[..., None]
        shown(name, f"{board} {text}", means(np.where(even, red, blue)))
    # In space: cells of 1 at z = .5, in front of the plate's own z = 0.
    cells = np.floor(2 * (2 * u - 1)) + np.floor(2 * (2 * v - 1))
    case("texture checkerboard of dimension 3", scene(
        f'{SUN}AttributeBegin Translate 0 0 -.25 Scale .5 .5 .5\nTexture "t" "spectrum" {board} '
        '"integer dimension" 3\nAttributeEnd\nMaterial "diffuse" "texture reflectance" "t"\n'
        + rectangle(), samples=256), means(np.where((cells % 2 == 0)[..., None], red, blue)))
    shown("unused beside",
          '"constant" "rgb value" [.8 .2 .1]\nTexture "other" "spectrum" "constant"',
          red)


def bricks(x, y, mortar):
    """Whether points are in the mortar of bricks of .5 by .25, rows of even number moved by .25."""
    row = np.floor(y / .25)
    x = x + np.where(row % 2 == 0, .25, 0)
    x, y = x - .5 * np.floor(x / .5), y - .25 * row
    edge = np.minimum(np.minimum(x, .5 - x), np.minimum(y, .25 - y))
    return (edge < mortar).astype(float)


def patterns():
    """Textures that are computed from the place, here on the plate z = 0."""
    u, v = grid()
    x, y = 2 * u - 1, 2 * v - 1
    p = np.stack([x, y, np.zeros_like(x)], axis=-1)
    # Numbers as colors, between .5 and .75.
    ends = '"rgb tex1" [.5 .5 .5] "rgb tex2" [.75 .75 .75] "texture amount" "n"'

    def number(name, texture, values, before=""):
        case("texture " + name, scene(
            f'{SUN}AttributeBegin {before}\nTexture "n" "float" {texture}\nAttributeEnd\n'
            f'Texture "t" "spectrum" "mix" {ends}\nMaterial "diffuse" "texture reflectance" "t"\n'
            + rectangle(), samples=1024), means(np.repeat((.5 + .25 * values)[..., None], 3, 2)))

    number("fbm", '"fbm"', fbm(p))
    number("fbm of octaves and roughness", '"fbm" "integer octaves" 3 "float roughness" .8',
           fbm(p, 3, .8))
    number("fbm under a CTM", '"fbm" "integer octaves" 2',
           fbm((p - (.2, 0, .3)) / (.5, .25, 1), 2), "Translate .2 0 .3 Scale .5 .25 1")
    number("wrinkled", '"wrinkled"', turbulence(p))
    number("wrinkled of octaves and roughness", '"wrinkled" "integer octaves" 4 '
           '"float roughness" .3', turbulence(p, 4, .3))
    number("windy", '"windy"', np.abs(fbm(.1 * (4 * p + 3), 3)) * fbm(4 * p + 3, 6),
           "Scale .25 .25 .25 Translate -3 -3 -3")
    number("node noise", '"node" "float scale" 2 "float detail" 1 "float roughness" .25',
           .5 + .5 * (lattice_noise(2 * p) + .25 * lattice_noise(4 * p)) / 1.25)
    number("node noise under a CTM", '"node" "float scale" 1 "float detail" 0',
           .5 + .5 * lattice_noise((p - (.2, 0, .3)) / (.5, .25, 1)),
           "Translate .2 0 .3 Scale .5 .25 1")
    number("node gradient of uv", '"node" "string node" "gradient" "string from" "uv"', u)
    number("node gradient of mapped uv", '"node" "string node" "gradient" "string from" "uv" '
           '"float placement" [0 .5 0 .25 0 1 0 0 0 0 1 0]', .5 * v + .25)
    number("node gradient, radial", '"node" "string node" "gradient" "string type" "radial"',
           np.arctan2(y, x) / (2 * PI) + .5)
    number("node wave", '"node" "string node" "wave" "string type" "rings" '
           '"string direction" "diagonal" "float scale" .5', .5 - .5 * np.cos(10 * np.hypot(x, y)))
    number("node brick", '"node" "string node" "brick" "float scale" .5 "float mortar_smooth" 0 '
           '"float mortar_size" .05', bricks(.5 * x, .5 * y, .05))
    case("texture ramp", scene(
        f'{SUN}Texture "n" "float" "node" "string node" "gradient" "string from" "uv"\n'
        'Texture "t" "spectrum" "ramp" "texture input" "n" "float positions" [.25 .5 .75] '
        '"float colors" [.8 .2 .1 .1 .3 .6 .5 .5 .5]\n'
        f'Material "diffuse" "texture reflectance" "t"\n{rectangle()}', samples=1024),
         means(np.stack([np.interp(u, (.25, .5, .75), c) for c in
                         ((.8, .1, .5), (.2, .3, .5), (.1, .6, .5))], axis=-1)))
    case("texture ramp of steps", scene(
        f'{SUN}Texture "n" "float" "node" "string node" "gradient" "string from" "uv"\n'
        'Texture "t" "spectrum" "ramp" "texture input" "n" "string interpolation" "constant" '
        '"float positions" [0 .5] "float colors" [.8 .2 .1 .1 .3 .6]\n'
        f'Material "diffuse" "texture reflectance" "t"\n{rectangle()}', samples=1024),
         means(np.where((u < .5)[..., None], (.8, .2, .1), (.1, .3, .6))))
    for name, text, q, variation in (("marble", "", p, .2),
                                     ("marble of scale and variation",
                                      '"float scale" 3 "float variation" 2', 3 * p, 2)):
        shown(name, f'"marble" {text}', means(marble(q, variation)))
    red, blue = np.array((.8, .2, .1)), np.array((.1, .3, .6))
    both = '"rgb inside" [.8 .2 .1] "rgb outside" [.1 .3 .6]'
    for name, text, s, t in (
            ("dots", '"float uscale" 4 "float vscale" 3', 4 * u, 3 * v),
            ("dots planar", '"string mapping" "planar" "vector3 v1" [2 0 0] "vector3 v2" [0 2 0]',
             2 * x, 2 * y)):
        shown(name, f'"dots" {both} {text}', means(np.where(dots(s, t)[..., None], red, blue)))
    corners = ('"rgb v00" [.8 .2 .1] "rgb v10" [.1 .3 .6] "rgb v01" [.5 .5 .5] '
               '"rgb v11" [.2 .9 .2]')
    s, t = u[..., None], v[..., None]
    shown("bilerp", f'"bilerp" {corners}', means(
        (1 - s) * (1 - t) * red + s * (1 - t) * blue + (1 - s) * t * .5
        + s * t * np.array((.2, .9, .2))))
    shown("bilerp of defaults", '"bilerp"', means(np.repeat(t, 3, 2)))
    for name, text, before, along in (
            ("directionmix along", '"vector3 dir" [0 0 2]', "", 1),
            ("directionmix across by default", "", "", 0),
            ("directionmix at 60 degrees", '"vector3 dir" [0 0 1]', "Rotate 60 1 0 0", .5)):
        case("texture " + name, scene(
            f'{SUN}AttributeBegin {before}\nTexture "t" "spectrum" "directionmix" '
            f'"rgb tex1" [.8 .2 .1] "rgb tex2" [.1 .3 .6] {text}\nAttributeEnd\n'
            f'Material "diffuse" "texture reflectance" "t"\n{rectangle()}', samples=256),
             along * red + (1 - along) * blue)


def nested():
    red, blue = np.array((.8, .2, .1)), np.array((.1, .3, .6))
    named = ('Texture "a" "spectrum" "constant" "rgb value" [.8 .2 .1]\n'
             'Texture "b" "spectrum" "constant" "rgb value" [.1 .3 .6]\n'
             'Texture "f" "float" "constant" "float value" .25\n'
             'Texture "g" "float" "scale" "texture tex" "f" "float scale" 2\n'
             'Texture "h" "float" "mix" "texture tex1" "f" "float tex2" .75 "float amount" .5\n')
    for name, texture, want in (
            ("mix of textures", '"mix" "texture tex1" "a" "texture tex2" "b"', (red + blue) / 2),
            ("mix by a texture", '"mix" "texture tex1" "a" "texture tex2" "b" "texture amount" "f"',
             .75 * red + .25 * blue),
            ("mix by a scaled texture", '"mix" "texture tex1" "a" "texture tex2" "b" '
             '"texture amount" "g"', (red + blue) / 2),
            ("mix by a mixed texture", '"mix" "texture tex1" "a" "texture tex2" "b" '
             '"texture amount" "h"', (red + blue) / 2),
            ("scale of a texture", '"scale" "texture tex" "a" "float scale" .5', red / 2),
            ("scale by a texture", '"scale" "texture tex" "a" "texture scale" "f"', red / 4),
            ("checkerboard of textures", '"checkerboard" "texture tex1" "a" "texture tex2" "b" '
             '"float uscale" 8 "float vscale" 8', (red + blue) / 2)):
        case("texture " + name, scene(
            f'{SUN}{named}Texture "t" "spectrum" {texture}\nMaterial "diffuse" '
            f'"texture reflectance" "t"\n{rectangle()}', samples=256), want)


def floats():
    """Float textures, seen as the share of a lamp behind that a cut-out lets pass."""
    u, v = grid()
    levels = np.round(TEXELS[:, :, :1] * 255) / 255
    linear = image("float.exr", TEXELS[:, :, :1])
    coded = image("float.png", levels, "uint8")
    color = image("float_rgb.exr", TEXELS)
    from scenes import lamp, BLACK  # pylint: disable=import-outside-toplevel

    def opaque(name, texture, share):
        case("float texture " + name, scene(
            lamp(rectangle(-2, 2, -2, 2, 1)) + f'Texture "f" "float" {texture}\n{BLACK}'
            + rectangle(more='"texture alpha" "f"'), samples=1024), 1 - np.asarray(share))

    def of(texels):
        return nearest(texels, u, v).mean() * np.ones(3)

    point = '"string filter" "point"'
    opaque("constant", '"constant" "float value" .3', gray(.3))
    opaque("imagemap", f'"imagemap" "string filename" "{linear}" {point}', of(TEXELS[:, :, :1]))
    opaque("scale", f'"imagemap" "string filename" "{linear}" {point} "float scale" .5',
           of(TEXELS[:, :, :1]) / 2)
    opaque("invert", f'"imagemap" "string filename" "{linear}" {point} "bool invert" true',
           1 - of(TEXELS[:, :, :1]))
    opaque("of a png", f'"imagemap" "string filename" "{coded}" {point}',
           of(srgb_to_linear(levels)))
    opaque("of a linear png", f'"imagemap" "string filename" "{coded}" {point} '
           '"string encoding" "linear"', of(levels))
    opaque("of a color image", f'"imagemap" "string filename" "{color}" {point}',
           of(TEXELS.mean(axis=2, keepdims=True)))
    opaque("mix", '"mix" "float tex1" .2 "float tex2" .6 "float amount" .25', gray(.3))
    opaque("scale of a value", '"scale" "float tex" .5 "float scale" .5', gray(.25))
    opaque("checkerboard", '"checkerboard" "float tex1" .1 "float tex2" .5 "float uscale" 4 '
           '"float vscale" 4', gray(.3))


def coordinates():
    """uv of each shape, by a checkerboard of many cells or a map along u."""
    ramp = np.tile(np.linspace(.05, .95, 8)[None, :, None], (8, 1, 3))
    file = image("ramp.exr", ramp)
    u, v = grid()
    head = f'"imagemap" "string filename" "{file}" "string filter" "point"'
    shown("on a mesh without uv", head, np.where((u < v)[..., None], nearest(ramp, u, v),
                                                 nearest(ramp, u, v)).mean(axis=(0, 1)),
          'Shape "trianglemesh" "point3 P" [-1 -1 0  1 -1 0  1 1 0] "integer indices" [0 1 2]\n'
          'Shape "trianglemesh" "point3 P" [-1 -1 0  1 1 0  -1 1 0] "point2 uv" [0 0 1 1 0 1] '
          '"integer indices" [0 1 2]')
    shown("on a patch without uv", head, means(nearest(ramp, u, v)),
          'Shape "bilinearmesh" "point3 P" [-1 -1 0 1 -1 0 -1 1 0 1 1 0]')
    shown("on a patch with uv", head, means(nearest(ramp, 1 - v, u)),
          'Shape "bilinearmesh" "point3 P" [-1 -1 0 1 -1 0 -1 1 0 1 1 0] '
          '"point2 uv" [1 0 1 1 0 0 0 1]')
    ply = write("uv.ply",
                "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
                "property float z\nproperty float u\nproperty float v\nelement face 1\n"
                "property list uchar int vertex_indices\nend_header\n-1 -1 0 0 0\n1 -1 0 1 0\n"
                "1 1 0 1 1\n-1 1 0 0 1\n4 0 1 2 3\n")
    shown("on a plymesh", head, means(nearest(ramp, u, v)),
          f'Shape "plymesh" "string filename" "{ply}"')
    # u of a disk is its azimuth.
    x, y = 2 * u - 1, 2 * v - 1
    azimuth = np.arctan2(y, x) % (2 * PI) / (2 * PI)
    shown("on a disk", head, means(nearest(ramp, azimuth, v)), 'Shape "disk" "float radius" 2')
    radius = np.hypot(x, y)
    column = image("column.exr", np.transpose(ramp, (1, 0, 2)))
    shown("on a disk along v", f'"imagemap" "string filename" "{column}" "string filter" "point"',
          means(nearest(np.transpose(ramp, (1, 0, 2)), u, 1 - radius / 2)),
          'Shape "disk" "float radius" 2')


maps()
files()
mappings()
mixtures()
patterns()
nested()
floats()
coordinates()
