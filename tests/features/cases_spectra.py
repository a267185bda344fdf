# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Spectra of lights, of surfaces and of indices of refraction."""
import numpy as np

import closed_forms as cf
from scenes import BLACK, LOOK, SUN, case, film, lamp, rectangle, scene, window, write

# Chromaticities of illuminants. Source: CIE 15:2004, tables T.3 and T.8; of acesD60, SMPTE.
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
        seen(f"black body of {kelvin} K", f'"blackbody L" {kelvin}',
             cf.rgb_of_light(cf.planck(kelvin)))
    for name, points in (("flat", (360, 1, 830, 1)), ("rising", (400, 0, 700, 1)),
                         ("falling", (400, 1, 700, 0)), ("peak", (450, 0, 550, 1, 650, 0)),
                         ("two peaks", (420, 0, 450, 1, 480, 0, 580, 0, 610, 1, 640, 0)),
                         ("step", (360, .2, 549, .2, 551, 1, 830, 1)),
                         ("part", (500, 1, 700, 1))):
        text = " ".join(str(p) for p in points)
        want = np.maximum(cf.rgb_of_light(cf.table(*points)), -9)
        seen(f"light of a spectrum, {name}", f'"spectrum L" [{text}]', want)
        seen(f"light of a spectrum, {name}, 3 times as high",
             f'"spectrum L" '
             f'[{" ".join(str(p * (3 if i % 2 else 1)) for i, p in enumerate(points))}]',
             want)
    file = write("lamp.spd", "# nm and value\n400 0\n550 1\n700 .5\n")
    seen("light of a file", f'"spectrum L" "{file}"',
         cf.rgb_of_light(cf.table(400, 0, 550, 1, 700, .5)))
    for color in ((1, .1, .1), (.1, 1, .1), (.1, .1, 1), (.9, .8, .1), (4, 2, 1)):
        seen(f"light of rgb {color}", f'"rgb L" [{color[0]} {color[1]} {color[2]}]', color)


def surfaces():
    flat = SUN.replace('"rgb L" [1 1 1]', '"spectrum L" [360 1 830 1]')

    def shown(name, sun, reflectance, want):
        case(name, scene(f'{sun}Material "diffuse" {reflectance}\n{rectangle()}', **SPECTRAL), want)

    for color in ((.9, .1, .1), (.1, .9, .1), (.1, .1, .9), (.8, .7, .1), (.2, .2, .2), (1, 1, 1),
                  (0, 0, 0), (.5, .25, .125)):
        shown(f"surface of rgb {color}", SUN,
              f'"rgb reflectance" [{color[0]} {color[1]} {color[2]}]',
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
    """A smooth mirror before the camera shows a lamp behind the camera."""
    def shown(name, light, material, want):
        points = " ".join(str(p) for p in light)
        case(name, scene(
            BLACK + lamp(f"Translate 0 0 -8 ReverseOrientation {rectangle(-9, 9, -9, 9)}",
                         f'"spectrum L" [{points}]')
            + f"Material {material}\n{rectangle()}", camera=LOOK + window(.5), films=film(4, 4),
            samples=1024, color="spectral",
            integrator='Integrator "path" "integer maxdepth" 2\n'), want)

    def metal(name, material, index, nms=(450, 550, 650)):
        """In bands so narrow that the index is that of their middle."""
        for nm in nms:
            band = (nm - 10, 0, nm, 1, nm + 10, 0)
            shown(f"{name} at {nm} nm", band, material,
                  cf.rgb_of_light(cf.table(*band)) * cf.fresnel(1, *index(nm)))

    for name, (eta, k) in METALS.items():
        metal(f"metal-{name}",
              f'"conductor" "spectrum eta" "metal-{name}-eta" "spectrum k" "metal-{name}-k"',
              lambda nm, eta=eta, k=k: (eta[(nm - 450) // 100], k[(nm - 450) // 100]),
              (450, 550, 650) if name in ("Cu", "CuZn") else (450, 650) if name == "Au"
              else (550,))
    metal("conductor of spectra",
          '"conductor" "spectrum eta" [400 1 700 2] "spectrum k" [400 3 700 6]',
          lambda nm: (1 + (nm - 400) / 300, 3 + (nm - 400) / 100))
    # A conductor that absorbs nothing reflects as glass does, without the noise of its choice.
    for name, eta in GLASSES.items():
        shown(f"glass-{name}", (360, 1, 830, 1),
              f'"conductor" "spectrum eta" "glass-{name}" "spectrum k" [300 0 900 0]',
              cf.rgb_of_light(lambda nm: 1, lambda nm, eta=eta: cf.fresnel(
                  1, np.interp(nm, (450, 550, 650), eta))))
    shown("dielectric of a spectrum", (360, 1, 830, 1),
          '"dielectric" "spectrum eta" [400 3 700 1.8]',
          cf.rgb_of_light(lambda nm: 1, lambda nm: cf.fresnel(
              1, np.interp(nm, (400, 700), (3, 1.8)))))


lights()
surfaces()
indices()
