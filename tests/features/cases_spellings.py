# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Spellings that must mean the same as those of the other cases."""
import math

from scenes import SUN, case, gray, image, lamp, rectangle, scene, write

# A plate of .1 .5 .9 that faces a light of irradiance pi.
COLOR = (.1, .5, .9)
HEAD = ('LookAt 0 0 -5  0 0 0  0 1 0\nCamera "orthographic"\nFilm "rgb" "integer xresolution" 4 '
        '"integer yresolution" 4\nPixelFilter "box"\nSampler "zsobol" "integer pixelsamples" 4\n'
        'Integrator "volpath" "integer maxdepth" 1\nWorldBegin\n')
PLATE = 'Material "diffuse" "rgb reflectance" [.1 .5 .9]\n'


def same(name, world, want=COLOR):
    case("spelling: " + name, HEAD + world, want)


def syntax():
    body = SUN + PLATE + rectangle()
    for name, world in (
            ("comments", "# first\n" + body.replace("\n", " # here\n")),
            ("one line", body.replace("\n", " ")),
            ("many lines", body.replace(" ", "\n").replace('"rgb\n', '"rgb ')
             .replace('"point3\n', '"point3 ').replace('"point2\n', '"point2 ')
             .replace('"integer\n', '"integer ').replace('"float\n', '"float ')),
            ("tabs", body.replace(" [", "\t[")),
            ("carriage returns", body.replace("\n", "\r\n")),
            ("no spaces about brackets", body.replace(" [", "[").replace("] ", "]")),
            ("a single value in brackets", body.replace(f'"float scale" {math.pi}',
                                                        f'"float scale" [ {math.pi} ]')),
            ("exponents", body.replace(".1 .5 .9", "1e-1 5E-1 0.9e+0")),
            ("leading zeros and signs", body.replace(".1 .5 .9", "0.100 00.5 +.9")),
            ("spaces within a type", body.replace('"rgb reflectance"', '"rgb   reflectance"')),
            ("a name in brackets", body.replace('"point3 from"', '"point3 from"'))):
        same(name, world)
    file = write("included.pbrt", PLATE)
    same("Include", SUN + f'Include "{file}"\n' + rectangle())
    same("Include of an include",
         SUN + f'Include "{write("outer.pbrt", f"Include {chr(34)}{file}{chr(34)}")}"'
         + "\n" + rectangle())
    same("Import of a plate", SUN + f'Import "{write("plate.pbrt", PLATE + rectangle())}"')


def types():
    body = SUN + PLATE + rectangle()
    same("point for point3", body.replace('"point3', '"point'))
    same("vector and normal",
         SUN + PLATE + rectangle(more='"normal N" [0 0 -1 0 0 -1 0 0 -1 0 0 -1]'))
    same("a bool in brackets", SUN + PLATE + lamp("", '"bool twosided" [false]') + rectangle())
    same("a spectrum of a value",
         SUN + 'Material "diffuse" "spectrum reflectance" [200 .5 900 .5]\n'
         + rectangle(), gray(.5))
    same("integer for float", SUN.replace(f"{math.pi}", "3") + PLATE + rectangle(),
         tuple(c * 3 / math.pi for c in COLOR))


def defaults():
    same("no material", SUN + rectangle(), gray(.5))
    same("Attribute light", 'Attribute "light" "float scale" 3.14159265\nLightSource "distant" '
         '"point3 from" [0 0 -1] "point3 to" [0 0 0]\n' + PLATE + rectangle())
    same("a parameter beats Attribute",
         SUN + 'Attribute "material" "rgb reflectance" [1 0 0]\n' + PLATE
         + rectangle())
    same("Attribute ends with its block", SUN + 'AttributeBegin\nAttribute "material" '
         '"rgb reflectance" [1 0 0]\nAttributeEnd\nMaterial "diffuse"\n' + rectangle(), gray(.5))
    same("a material ends with its block", SUN + PLATE + 'AttributeBegin\nMaterial "diffuse" '
         '"rgb reflectance" [1 0 0]\nAttributeEnd\n' + rectangle())
    same("a named material used before it is made", SUN + 'NamedMaterial "m"\n' + rectangle()
         + 'MakeNamedMaterial "m" "string type" "diffuse" "rgb reflectance" [.1 .5 .9]\n')
    same("an area light ends with its block",
         'AttributeBegin\nAreaLightSource "diffuse"\nAttributeEnd\n'
         + SUN + PLATE + rectangle())
    flat = image("spelled.exr", [[list(COLOR)] * 2] * 2)
    same("a texture of an image",
         SUN + f'Texture "t" "spectrum" "imagemap" "string filename" "{flat}"\n'
         'Material "diffuse" "texture reflectance" "t"\n' + rectangle())
    same("a texture named like a parameter", SUN + 'Texture "reflectance" "spectrum" "constant" '
         '"rgb value" [.1 .5 .9]\nMaterial "diffuse" "texture reflectance" "reflectance"\n'
         + rectangle())
    same("a material named like a type",
         SUN + 'MakeNamedMaterial "conductor" "string type" "diffuse" '
         '"rgb reflectance" [.1 .5 .9]\nNamedMaterial "conductor"\n' + rectangle())


syntax()
types()
defaults()
