# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Materials: what they reflect and transmit, by Lambert, Fresnel, GGX and sums of layers."""
import math

import numpy as np

import closed_forms as cf
from scenes import (BLACK, LOOK, SUN, case, gray, image, lamp, rectangle, scene, window)

PI = math.pi
SKY = 'LightSource "infinite" "rgb L" [1 1 1]\n'
PATHS = 'Integrator "volpath" "integer maxdepth" {}\n'


def sun(name, material, want, **more):
    """Under a light of irradiance pi along the normal, seen along the normal."""
    case("material " + name, scene(f"{SUN}Material {material}\n{rectangle()}", **more), want)


def furnace(name, material, want, angle=0, depth=20, shape=None, samples=256, **more):
    """A plate under a uniform sky, seen at an angle."""
    t = math.radians(angle)
    case("furnace " + name, scene(
        f"{SKY}Material {material}\n{shape or rectangle(-9, 9, -9, 9)}", samples=samples,
        camera=f"LookAt {-5 * math.sin(t)} 0 {-5 * math.cos(t)}  0 0 0  0 1 0\n" + window(.01),
        integrator=PATHS.format(depth), **more), want)


def diffuse():
    sun("diffuse default", '"diffuse"', gray(.5))
    sun("diffuse reflectance", '"diffuse" "rgb reflectance" [.1 .5 .9]', (.1, .5, .9))
    sun("diffusetransmission default, reflected", '"diffusetransmission"', gray(.25))
    for name, text, r, t in (
            ("reflectance and transmittance",
             '"rgb reflectance" [.1 .2 .3] "rgb transmittance" [.4 .3 .2]', (.1, .2, .3),
             (.4, .3, .2)),
            ("scale",
             '"rgb reflectance" [.1 .2 .3] "rgb transmittance" [.4 .3 .2] "float scale" .5',
             (.05, .1, .15), (.2, .15, .1))):
        sun(f"diffusetransmission {name}, reflected", f'"diffusetransmission" {text}', r)
        case(f"material diffusetransmission {name}, transmitted", scene(
            SUN.replace("[0 0 -1]", "[0 0 1]") + f'Material "diffusetransmission" {text}\n'
            + rectangle()), t)
    sun("named", '"diffuse"\nMakeNamedMaterial "m" "string type" "diffuse" "rgb reflectance" '
        '[.1 .5 .9]\nNamedMaterial "m"', (.1, .5, .9))
    sun("by Attribute", '"diffuse"\nAttribute "material" "rgb reflectance" [.1 .5 .9]\n'
        'Material "diffuse"', (.1, .5, .9))
    for amount in (0, .25, .5, 1):
        sun(f"mix amount {amount}",
            '"diffuse"\nMakeNamedMaterial "a" "string type" "diffuse" "rgb reflectance" [.1 .5 '
            '.9]\n'
            'MakeNamedMaterial "b" "string type" "diffuse" "rgb reflectance" [.9 .1 .3]\n'
            f'Material "mix" "string materials" ["a" "b"] "float amount" {amount}',
            np.array((.1, .5, .9)) * (1 - amount) + np.array((.9, .1, .3)) * amount, samples=1024)
    case("material interface is not seen", scene(
        lamp(rectangle(z=1)) + 'Material "interface"\n' + rectangle()), gray(1))
    furnace("diffuse", '"diffuse" "rgb reflectance" [.1 .5 .9]', (.1, .5, .9))
    furnace("diffuse from the side", '"diffuse" "rgb reflectance" [.1 .5 .9]', (.1, .5, .9), 70)


def conductors():
    for eta, k in ((.2, 3), (1.5, 0), (2, 4)):
        text = f'"conductor" "spectrum eta" [300 {eta} 900 {eta}] "spectrum k" [300 {k} 900 {k}]'
        for angle in (0, 45, 75):
            furnace(f"conductor of {eta} + {k} i at {angle} degrees", text,
                    gray(cf.fresnel(math.cos(math.radians(angle)), eta, k)), angle,
                    color="spectral")
    furnace("conductor reflectance", '"conductor" "rgb reflectance" [.9 .5 .2]', (.9, .5, .2))
    # The reflectance at normal incidence gives eta = 1 and k = 2 sqrt(r / (1 - r)).
    want = [cf.fresnel(math.cos(math.radians(60)), 1,
                       2 * math.sqrt(r / (1 - r))) for r in (.9, .5, .2)]
    furnace("conductor reflectance at 60 degrees", '"conductor" "rgb reflectance" [.9 .5 .2]',
            want, 60)


def dielectrics():
    glass = 'Translate 0 0 {}\n' + rectangle(-9, 9, -9, 9)
    for eta in (1.3, 1.5, 2):
        for angle in (0, 45, 70):
            f = cf.fresnel(math.cos(math.radians(angle)), eta)
            # The ground is black: what is transmitted is lost.
            case(f"dielectric of {eta} at {angle} degrees", scene(
                f'{SKY}AttributeBegin Material "dielectric" "float eta" {eta}\n'
                + rectangle(-9, 9, -9, 9) + f"AttributeEnd\n{BLACK}" + rectangle(-99, 99, -99, 99,
                                                                                 .01),
                samples=1024, integrator=PATHS.format(9),
                camera=f"LookAt {-5 * math.sin(math.radians(angle))} 0 "
                f"{-5 * math.cos(math.radians(angle))}  0 0 0  0 1 0\n" + window(.01)), gray(f))
            furnace(f"thindielectric of {eta} at {angle} degrees",
                    f'"thindielectric" "float eta" {eta}',
                    gray(2 * f / (1 + f)), angle, samples=1024,
                    shape=rectangle(-9, 9, -9, 9) + BLACK + rectangle(-99, 99, -99, 99, .01))
    f = cf.fresnel(1, 1.5)
    back = BLACK + lamp(rectangle(-9, 9, -9, 9, 3))
    case("two faces of glass transmit", scene(
        back + 'Material "dielectric" "float eta" 1.5\n' + glass.format(0) +
        "Translate 0 0 1\nReverseOrientation\n" + rectangle(-9, 9, -9, 9), samples=1024,
        integrator=PATHS.format(20)), gray((1 - f) / (1 + f)))
    case("thindielectric transmits", scene(
        back + 'Material "thindielectric" "float eta" 1.5\n' + glass.format(0), samples=1024,
        integrator=PATHS.format(20)), gray((1 - f) / (1 + f)))
    case("a ball of glass under a sky", scene(
        SKY + 'Material "dielectric" "float eta" 1.5\nShape "sphere"', camera=LOOK + window(.6),
        integrator=PATHS.format(60), samples=256), gray(1))


def rough():
    """GGX under the light of irradiance pi: D F G / (4 cos) times pi."""
    k = '"spectrum eta" [300 .2 900 .2] "spectrum k" [300 3 900 3]'

    def peak(ax, ay, f=cf.fresnel(1, .2, 3)):
        return gray(f * cf.ggx(0, 0, ax, ay) / 4 * PI)

    for r in (.1, .3, .7):
        a = math.sqrt(r)
        sun(f"conductor of roughness {r}", f'"conductor" {k} "float roughness" {r}', peak(a, a),
            color="spectral", samples=256)
    sun("conductor of alpha .3",
        f'"conductor" {k} "float roughness" .3 "bool remaproughness" false',
        peak(.3, .3), color="spectral", samples=256)
    sun("conductor of two roughnesses",
        f'"conductor" {k} "float uroughness" .1 "float vroughness" .4',
        peak(math.sqrt(.1), math.sqrt(.4)), color="spectral", samples=256)
    sun("conductor of a roughness texture",
        '"diffuse"\nTexture "r" "float" "constant" "float value" .3\n'
        f'Material "conductor" {k} "texture roughness" "r"', peak(math.sqrt(.3), math.sqrt(.3)),
        color="spectral", samples=256)
    for eta in (1.3, 1.8):
        sun(f"dielectric of {eta}, rough", f'"dielectric" "float eta" {eta} "float roughness" .2',
            peak(math.sqrt(.2), math.sqrt(.2), cf.fresnel(1, eta)), samples=1024)

    def aside(name, ax, ay, to_light, shape=None, tangent=0.0, text=""):
        """Light from a direction (x, y, z), z towards the camera; tangent: angle of u to x."""
        w = cf.normalize(to_light)
        c, s = math.cos(math.radians(tangent)), math.sin(math.radians(tangent))
        local = np.array([c * w[0] + s * w[1], -s * w[0] + c * w[1], w[2]])
        h = cf.normalize(local + (0, 0, 1))
        f = cf.fresnel(h[2], .2, 3)
        g = 1 / (1 + cf.smith_lambda(local, ax, ay))
        want = f * cf.ggx(h[0] / h[2], h[1] / h[2], ax, ay) * g / 4 * PI
        light = SUN.replace("[0 0 -1]", f"[{w[0]} {w[1]} {-w[2]}]")
        case("material anisotropic " + name, scene(
            f'{light}Material "conductor" {k} "bool remaproughness" false "float uroughness" {ax} '
            f'"float vroughness" {ay}\n{text}{shape or rectangle()}', samples=256,
            camera=LOOK + window(.5), color="spectral"),
             gray(want))

    for name, d in (("along x", (.5, 0, 1)), ("along y", (0, .5, 1)), ("across", (.4, .3, 1))):
        aside(f"light {name}", .1, .4, d)
        aside(f"light {name}, the other way", .4, .1, d)
    turned = ('Shape "trianglemesh" "point3 P" [-1 -1 0 -1 1 0 1 1 0 1 -1 0] "point2 uv" [0 0 0 1 '
              '1 1 '
              '1 0] "integer indices" [0 1 2 0 2 3] "vector3 S" [{0} {0} {0} {0}]')
    for degrees in (0, 30, 45, 90):
        t = math.radians(degrees)
        s = f"{math.cos(t):.6f} {math.sin(t):.6f} 0"
        for name, d in (("along x", (.5, 0, 1)), ("across", (.4, .3, 1))):
            aside(f"mesh tangents at {degrees} degrees, light {name}", .1, .4, d, turned.format(s),
                  degrees)
    aside("mesh tangents of another length and tilt", .1, .4, (.4, .3, 1),
          turned.format("3 3 5"), 45)
    aside("mesh tangents in a turned mesh", .1, .4, (.4, .3, 1), turned.format("1 0 0"), 30,
          text="Rotate 30 0 0 1\n")
    aside("mesh tangents in an object", .1, .4, (.4, .3, 1), 'ObjectBegin "o"\n'
          + turned.format("1 1 0") + '\nObjectEnd\nRotate 20 0 0 1\nObjectInstance "o"', 65)
    aside("uv that is turned", .1, .4, (.4, .3, 1),
          rectangle().replace("[0 0 0 1 1 1 1 0]", "[0 0 1 0 1 1 0 1]"), 90)


def coats():
    """Smooth layers: light between them is a geometric series."""
    f = cf.fresnel(1, 1.5)
    # A diffuse base: f outside, and inside the average over all directions.
    c = (np.arange(200000) + .5) / 200000
    out = np.array([1.0 if 1 - x * x >= 1 / 2.25 else cf.fresnel(x, 1 / 1.5) for x in c[::20]])
    inside = (out * 2 * c[::20]).mean()
    for r in (0, .2, .5, .9, 1):
        furnace(f"coateddiffuse of reflectance {r}",
                f'"coateddiffuse" "float roughness" 0 "rgb reflectance" [{r} {r} {r}] '
                '"float thickness" 0', gray(f + (1 - f) * (1 - inside) * r / (1 - inside * r)))
    for angle in (50, 75):
        g = cf.fresnel(math.cos(math.radians(angle)), 1.5)
        furnace(f"coateddiffuse at {angle} degrees",
                '"coateddiffuse" "float roughness" 0 "rgb reflectance" [.5 .5 .5] "float '
                'thickness" 0',
                gray(g + (1 - g) * (1 - inside) * .5 / (1 - inside * .5)), angle)
    for eta in (1.2, 1.8):
        g = cf.fresnel(1, eta)
        furnace(f"coateddiffuse of eta {eta} over black", f'"coateddiffuse" "float eta" {eta} '
                '"float roughness" 0 "rgb reflectance" [0 0 0]', gray(g))
    for n, k in ((.2, 3), (2, 4)):
        base = cf.fresnel(1, n / 1.5, k / 1.5)
        furnace(f"coatedconductor of {n} + {k} i",
                '"coatedconductor" "float interface.roughness" 0 "float conductor.roughness" 0 '
                f'"spectrum conductor.eta" [300 {n} 900 {n}] "spectrum conductor.k" [300 {k} 900 '
                f'{k}] '
                '"float thickness" 0', gray(f + (1 - f) ** 2 * base / (1 - f * base)),
                color="spectral")
    furnace("coatedconductor reflectance",
            '"coatedconductor" "float interface.roughness" 0 "float conductor.roughness" 0 '
            '"rgb reflectance" [.9 .5 .2] "float thickness" 0',
            [f + (1 - f) ** 2 * b / (1 - f * b) for b in coated_base((.9, .5, .2))])


def coated_base(reflectances):
    """k for a reflectance is against vacuum, and both constants are divided by the coat's index."""
    return [cf.fresnel(1, 1 / 1.5, 2 * math.sqrt(r / (1 - r)) / 1.5) for r in reflectances]


def normals():
    """The sun at 40 degrees to either side of a normal that is turned by 10 to the right."""
    white = '"diffuse" "rgb reflectance" [1 1 1]'
    t = math.radians(10)
    texel = [math.sin(t) / 2 + .5, .5, math.cos(t) / 2 + .5]
    file = image("normal.exr", [[texel] * 2] * 2)
    # Height falls along u, which goes from 0 to 1 over a width of 2.
    ramp = image("slope.exr", np.tile((63.5 - np.arange(64))[None, :] / 64 * 2 * math.tan(t),
                                     (2, 1))[:, :, None])
    vertices = ('Shape "trianglemesh" "point3 P" [-1 -1 0 -1 1 0 1 1 0 1 -1 0] "integer indices" '
                '[0 1 2 0 2 3] "normal N" ['
                + f"{math.sin(t)} 0 {-math.cos(t)} " * 4 + "]\n")
    height = f'Texture "h" "float" "imagemap" "string filename" "{ramp}"\n'
    for name, before, material, shape in (
            ("normal map", "", f'{white} "string normalmap" "{file}"', rectangle()),
            ("bump map", height, f'{white} "texture displacement" "h"', rectangle()),
            ("vertex normals", "", white, vertices)):
        for side, sign in (("right", 1), ("left", -1)):
            x, z = math.sin(math.radians(40)), math.cos(math.radians(40))
            light = SUN.replace("[0 0 -1]", f"[{sign * x} 0 {-z}]")
            case(f"{name}, light from the {side}", scene(
                f"{light}{before}Material {material}\n{shape}", samples=256,
                camera=LOOK + window(.5)), gray(math.cos(math.radians(40 - 10 * sign))))


def tilted_normals():
    """Whatever tilts the normals of a white plate, it keeps all light."""
    white = '"diffuse" "rgb reflectance" [1 1 1]'
    for degrees in (10, 25, 40):
        t = math.radians(degrees)
        file = image(f"normal{degrees}.exr",
                     [[[math.sin(t) / 2 + .5, .5, math.cos(t) / 2 + .5]] * 2] * 2)
        furnace(f"normal map of {degrees} degrees", f'{white} "string normalmap" "{file}"',
                gray(1))
        furnace(f"vertex normals of {degrees} degrees", white, gray(1), shape=rectangle(
            -9, 9, -9, 9, more='"normal N" [' + f"{math.sin(t)} 0 {-math.cos(t)} " * 4 + "]"))


diffuse()
conductors()
dielectrics()
rough()
coats()
normals()
tilted_normals()
