# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Spectra of lights, of surfaces and of indices of refraction."""
import numpy as np

import closed_forms as cf
from scenes import LOOK, SUN, case, lamp, rectangle, scene, window, write

# Chromaticities of the CIE's illuminants. Source: CIE 15:2004, tables T.3 and T.8; of acesD60, SMPTE.
ILLUMINANTS = {
    "stdillum-A": (.44757, .40745), "stdillum-D50": (.34567, .35851),
    "stdillum-D65": (.31272, .32903), "illum-acesD60": (.32168, .33767),
    "stdillum-F1": (.3131, .3371), "stdillum-F2": (.3721, .3751), "stdillum-F3": (.4091, .3941),
    "stdillum-F4": (.4402, .4031), "stdillum-F5": (.3138, .3452), "stdillum-F6": (.3779, .3882),
    "stdillum-F7": (.3129, .3292), "stdillum-F8": (.3458, .3586), "stdillum-F9": (.3741, .3727),
    "stdillum-F10": (.3458, .3588), "stdillum-F11": (.3805, .3769),
    "stdillum-F12": (.4370, .4042)}
# Index and absorption at 450, 550 and 650 nm. Sources: Johnson and Christy 1972 (Cu, Ag, Au), Rakic
# 1995 (Al), the SOPRA tables (brass, MgO, TiO2), Schott (glasses; SF5, SF10, SF11 by their F5 ...).
METALS = {"Cu": ((1.166, .958, .2166), (2.394, 2.577, 3.638)),
          "Au": ((1.509, .3504, .1678), (1.879, 2.714, 3.138)),
          "Ag": ((.1517, .1248, .1394), (2.470, 3.340, 4.129)),
          "Al": ((.618, .9586, 1.4748), (5.469, 6.687, 7.794)),
          "CuZn": ((1.094, .527, .444), (1.829, 2.765, 3.695)),
          "MgO": ((1.7524, 1.7405, 1.7337), (0, 0, 0)),
          "TiO2": ((3.165, 2.955, 2.860), (0, 0, 0))}
GLASSES = {"BK7": (1.5253, 1.5185, 1.5145), "BAF10": (1.6845, 1.6733, 1.6660),
           "FK51A": (1.4931, 1.4878, 1.4849), "LASF9": (1.8790, 1.8565, 1.8437),
           "F5": (1.6948, 1.6776, 1.6674), "F10": (1.7594, 1.7328, 1.7210),
           "F11": (1.8176, 1.7919, 1.7768)}
SPECTRAL = {"color": "spectral", "samples": 512}


def seen(name, light, want, **more):
    case(name, scene(lamp(rectangle(), light), **{**SPECTRAL, **more}), want)


def lights():
    for name, (x, y) in ILLUMINANTS.items():
        seen(f"light of {name}", f'"spectrum L" "{name}"', cf.rgb_of_xy(x, y))
    for kelvin in (1800, 2400, 3000, 4000, 5000, 6500, 9000, 15000):
        seen(f"black body of {kelvin} K", f'"blackbody L" {kelvin}', cf.rgb_of_light(cf.planck(kelvin)))
    for name, points in (("flat", (360, 1, 830, 1)), ("rising", (400, 0, 700, 1)),
                         ("falling", (400, 1, 700, 0)), ("peak", (450, 0, 550, 1, 650, 0)),
                         ("two peaks", (420, 0, 450, 1, 480, 0, 580, 0, 610, 1, 640, 0)),
                         ("step", (360, .2, 549, .2, 551, 1, 830, 1)),
                         ("part", (500, 1, 700, 1))):
        text = " ".join(str(p) for p in points)
        want = np.maximum(cf.rgb_of_light(cf.table(*points)), -9)
        seen(f"light of a spectrum, {name}", f'"spectrum L" [{text}]', want)
        seen(f"light of a spectrum, {name}, 3 times as high",
             f'"spectrum L" [{" ".join(str(p * (3 if i % 2 else 1)) for i, p in enumerate(points))}]',
             want)
    file = write("lamp.spd", "# nm and value\n400 0\n550 1\n700 .5\n")
    seen("light of a file", f'"spectrum L" "{file}"', cf.rgb_of_light(cf.table(400, 0, 550, 1, 700, .5)))
    for color in ((1, .1, .1), (.1, 1, .1), (.1, .1, 1), (.9, .8, .1), (4, 2, 1)):
        seen(f"light of rgb {color}", f'"rgb L" [{color[0]} {color[1]} {color[2]}]', color)


def surfaces():
    flat = SUN.replace('"rgb L" [1 1 1]', '"spectrum L" [360 1 830 1]')

    def shown(name, sun, reflectance, want):
        case(name, scene(f'{sun}Material "diffuse" {reflectance}\n{rectangle()}', **SPECTRAL), want)

    for color in ((.9, .1, .1), (.1, .9, .1), (.1, .1, .9), (.8, .7, .1), (.2, .2, .2), (1, 1, 1),
                  (0, 0, 0), (.5, .25, .125)):
        shown(f"surface of rgb {color}", SUN, f'"rgb reflectance" [{color[0]} {color[1]} {color[2]}]',
              color)
    for name, points in (("flat", (300, .3, 900, .3)), ("rising", (400, 0, 700, 1)),
                         ("band", (490, 0, 500, 1, 570, 1, 580, 0)),
                         ("two bands", (300, .8, 480, .8, 500, .1, 600, .1, 620, .8, 900, .8))):
        text = " ".join(str(p) for p in points)
        shown(f"surface of a spectrum, {name}", flat, f'"spectrum reflectance" [{text}]',
              cf.rgb_of_light(lambda nm: 1, cf.table(*points)))
    file = write("paint.spd", "400 .2\n500 .2\n520 .9\n700 .7\n")
    shown("surface of a file", flat, f'"spectrum reflectance" "{file}"',
          cf.rgb_of_light(lambda nm: 1, cf.table(400, .2, 500, .2, 520, .9, 700, .7)))
    warm = SUN.replace('"rgb L" [1 1 1]', '"blackbody L" 3000')
    shown("surface of a spectrum under a black body", warm, '"spectrum reflectance" [400 0 700 1]',
          cf.rgb_of_light(cf.planck(3000), cf.table(400, 0, 700, 1)))


def indices():
    """A smooth mirror before the camera shows the lamp behind it, in a band of 2 nm."""
    def shown(name, material, reflectance):
        for i, nm in enumerate((450, 550, 650)):
            band = (nm - 1, 0, nm, 1, nm + 1, 0)
            light = " ".join(str(b) for b in band)
            # Luminance shows the reflectance; red, green and blue of a band may be negative.
            case(f"{name} at {nm} nm", scene(
                lamp("Translate 0 0 -8\nReverseOrientation\n" + rectangle(-9, 9, -9, 9),
                     f'"spectrum L" [{light}]') + f"Material {material}\n" + rectangle(),
                camera=LOOK + window(.5), samples=16,
                integrator='Integrator "path" "integer maxdepth" 2\n', color="spectral"),
                 np.maximum(0, cf.rgb_of_xy(*chromaticity(nm))) * reflectance[i])

    def chromaticity(nm):
        xyz = np.array([np.interp(nm, cf.NM, c) for c in cf.CMF])
        return xyz[0] / xyz.sum(), xyz[1] / xyz.sum()

    for name, (eta, k) in METALS.items():
        shown(f"metal-{name}", f'"conductor" "spectrum eta" "metal-{name}-eta" '
              f'"spectrum k" "metal-{name}-k"', [cf.fresnel(1, eta[i], k[i]) for i in range(3)])
    for name, eta in GLASSES.items():
        shown(f"glass-{name}", f'"dielectric" "spectrum eta" "glass-{name}"',
              [cf.fresnel(1, e) for e in eta])
    shown("conductor of spectra", '"conductor" "spectrum eta" [400 1 700 2] '
          '"spectrum k" [400 3 700 6]',
          [cf.fresnel(1, 1 + t, 3 + 3 * t) for t in ((nm - 400) / 300 for nm in (450, 550, 650))])
    shown("dielectric of a spectrum", '"dielectric" "spectrum eta" [400 2 700 1.4]',
          [cf.fresnel(1, 2 - .6 * (nm - 400) / 300) for nm in (450, 550, 650)])


lights()
surfaces()
indices()
