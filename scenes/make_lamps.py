#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Writes lamps.pbrt: a thousand small lamps of many colors over a glossy floor.

    scenes/make_lamps.py
"""
import os

ROWS, COLUMNS = 40, 25
RADIUS = 0.02
# The light of lamps, as a fraction of red, green and blue.
TINTS = [(1, 0.3, 0.2), (1, 0.8, 0.4), (0.3, 0.6, 1), (0.4, 1, 0.5), (1, 0.4, 0.9)]

HEAD = """# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
# Made by make_lamps.py: a thousand small lamps of many colors over a floor that reflects them
# dimly. A point of the floor reflects few of all lamps to the camera: those about its mirror
# direction, not the nearest ones. Lengths are in meters.
Film "rgb" "integer xresolution" 320 "integer yresolution" 200
  "string filename" "lamps.exr"
Sampler "zsobol" "integer pixelsamples" 64
Integrator "volpath" "integer maxdepth" 3
LookAt 0 -12 2.2   0 -4 0   0 0 1
Camera "perspective" "float fov" 50

WorldBegin
Material "coateddiffuse" "rgb reflectance" [0.06 0.06 0.07] "float roughness" 0.1
  "bool remaproughness" false
Shape "bilinearmesh" "point3 P" [-20 -14 0   20 -14 0   -20 26 0   20 26 0]
Material "conductor" "spectrum eta" "metal-Cu-eta" "spectrum k" "metal-Cu-k" "float roughness" 0.1
  "bool remaproughness" false
AttributeBegin Translate -2.2 -6 0.7 Shape "sphere" "float radius" 0.7 AttributeEnd
AttributeBegin Translate 2.4 -5 0.9 Shape "sphere" "float radius" 0.9 AttributeEnd

"""


def lamp_at(index):
    """The place of a lamp, near that of a lattice."""
    row, column = divmod(index, COLUMNS)
    # Fractions of multiples of irrational numbers spread evenly.
    dx, dy, dz = ((index * step) % 1 - 0.5 for step in (0.61803399, 0.75487767, 0.56984029))
    return (1.0 * (column - COLUMNS // 2) + 0.6 * dx, 0.8 * (row - 10) + 0.5 * dy, 2.6 + 1.6 * dz)


def lamps():
    lines = []
    for tint, color in enumerate(TINTS):
        radiance = " ".join(f"{120 * part:g}" for part in color)
        lines.append(f'AttributeBegin AreaLightSource "diffuse" "rgb L" [{radiance}]')
        at = (0, 0, 0)
        for index in range(tint, ROWS * COLUMNS, len(TINTS)):
            to = tuple(round(value, 2) for value in lamp_at(index * 7 % (ROWS * COLUMNS)))
            step = " ".join(f"{round(b - a, 2):g}" for a, b in zip(at, to))
            lines.append(f'  Translate {step} Shape "sphere" "float radius" {RADIUS:g}')
            at = to
        lines.append("AttributeEnd")
    return "\n".join(lines)


def main():
    path = os.path.join(os.path.dirname(os.path.abspath(__file__)), "lamps.pbrt")
    with open(path, "w", encoding="utf-8") as file:
        file.write(HEAD + lamps() + "\n")


if __name__ == "__main__":
    main()
