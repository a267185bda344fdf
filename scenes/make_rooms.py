#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Writes rooms.pbrt: 10 x 10 rooms with doors, each with four lamps of its own; a few are seen.

    scenes/make_rooms.py
"""
import os

ACROSS = 10
HEIGHT = 1.0  # The walls'; a room is a square of side 1.
DOOR, LINTEL = 0.24, 0.7       # Width and height of a door.
LAMPS = [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)]
LAMP_RADIUS, LAMP_HEIGHT = 0.03, 0.8
# The light of lamps by the room's number, as a fraction of red, green and blue.
TINTS = [(1, 0.86, 0.62), (1, 0.72, 0.42), (0.8, 0.9, 1), (1, 0.95, 0.85), (0.75, 1, 0.85)]

HEAD = """# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
# Made by make_rooms.py: a few of a hundred rooms with doors, without a roof, each lit by four lamps
# of its own. Nearly all lamps are behind walls: choices by distance alone mostly sample these.
# Lengths are in rooms.
Film "rgb" "integer xresolution" 320 "integer yresolution" 320
  "string filename" "rooms.exr"
Sampler "zsobol" "integer pixelsamples" 64
Integrator "volpath" "integer maxdepth" 4
LookAt 4.6 2.6 3.6   4.5 4.5 0   0 0 1
Camera "perspective" "float fov" 36

WorldBegin
Material "diffuse" "rgb reflectance" [0.6 0.56 0.5]
Shape "bilinearmesh" "point3 P" [-0.5 -0.5 0   10.5 -0.5 0   -0.5 10.5 0   10.5 10.5 0]
"""


def quads_text(quads):
    """One mesh of rectangles, each by two opposite corners of a wall of no thickness."""
    points, indices = [], []
    for (x0, y0, z0), (x1, y1, z1) in quads:
        first = len(points)
        points += [(x0, y0, z0), (x1, y1, z0), (x1, y1, z1), (x0, y0, z1)]
        indices += [first + corner for corner in (0, 1, 2, 0, 2, 3)]
    lines = ['Shape "trianglemesh"', '  "integer indices" [']
    lines += wrapped([str(index) for index in indices])
    lines += ["  ]", '  "point3 P" [']
    lines += wrapped([f"{value:g}" for point in points for value in point])
    return "\n".join(lines + ["  ]"])


def wrapped(words):
    """The words in lines of at most 100 columns."""
    lines, line = [], "   "
    for word in words:
        if len(line) + 1 + len(word) > 100:
            lines.append(line)
            line = "   "
        line += " " + word
    return lines + [line]


def walls():
    quads = []
    for line in range(ACROSS + 1):
        for room in range(ACROSS):
            has_door = 0 < line < ACROSS and (line + room) % 3 != 0
            parts = [(0, 1, 0, HEIGHT)]
            if has_door:
                low, high = 0.5 - DOOR / 2, 0.5 + DOOR / 2
                parts = [(0, low, 0, HEIGHT), (low, high, LINTEL, HEIGHT), (high, 1, 0, HEIGHT)]
            for begin, end, below, above in parts:
                quads.append(((line, room + begin, below), (line, room + end, above)))
                quads.append(((room + begin, line, below), (room + end, line, above)))
    return quads_text(quads)


def lamps():
    lines = []
    for room in range(ACROSS * ACROSS):
        x, y = room % ACROSS, room // ACROSS
        radiance = " ".join(f"{30 * part:g}" for part in TINTS[(x * 2 + y * 3) % len(TINTS)])
        lines.append(f'AttributeBegin AreaLightSource "diffuse" "rgb L" [{radiance}]')
        at = (0, 0, 0)
        for lamp_x, lamp_y in LAMPS:
            to = (x + lamp_x, y + lamp_y, LAMP_HEIGHT)
            lines.append(f"  Translate {to[0] - at[0]:g} {to[1] - at[1]:g} {to[2] - at[2]:g} "
                         f'Shape "sphere" "float radius" {LAMP_RADIUS:g}')
            at = to
        lines.append("AttributeEnd")
    return "\n".join(lines)


def main():
    path = os.path.join(os.path.dirname(os.path.abspath(__file__)), "rooms.pbrt")
    with open(path, "w", encoding="utf-8") as file:
        file.write(HEAD + 'Material "diffuse" "rgb reflectance" [0.7 0.68 0.64]\n' + walls() +
                   "\n\n# Lamps, room by room.\n" + lamps() + "\n")


if __name__ == "__main__":
    main()
