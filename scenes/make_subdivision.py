#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Makes the control meshes of the goblet, its wine and the waves of the pool: shapes of type
loopsubdiv, in gzipped pbrt files.

Needs nothing but Python. The outputs are committed; run it again after a change:
    python3 scenes/make_subdivision.py
"""
import gzip
import math
import os
import random

HERE = os.path.dirname(os.path.abspath(__file__))

# Profiles (radius, height) in decimetres, from the axis below along the outside to the axis above.
GOBLET = [(0, 0), (.15, 0), (.28, 0), (.335, .004), (.35, .018), (.335, .034), (.24, .05),
          (.14, .07), (.075, .11), (.05, .17), (.042, .27), (.042, .38), (.05, .48), (.085, .55),
          (.18, .61), (.29, .68), (.38, .78), (.43, .9), (.445, 1.03), (.43, 1.16), (.4, 1.3),
          (.365, 1.42), (.355, 1.452), (.345, 1.46), (.337, 1.45), (.34, 1.41), (.372, 1.295),
          (.402, 1.16), (.416, 1.03), (.402, .905), (.355, .795), (.27, .705), (.17, .645),
          (.08, .612), (0, .6)]
# The wine ends in the middle of the glass, whose priority is higher.
WINE = [(0, .575), (.082, .585), (.175, .63), (.28, .692), (.368, .79), (.416, .9), (.43, .985),
        (.4305, .998), (.43, 1), (.42, 1), (.38, 1), (.25, 1), (.12, 1), (0, 1)]
AROUND = 24

# The water in metres: it reaches into the walls of the basin, 5 by 8 m.
WATER_X, WATER_Z, SPACING = (-2.6, 2.6), (-0.1, 8.1), 0.12
# A crest of curvature K focuses the light of the zenith at a depth of about 4 / K (Snell's law).
WAVES, LENGTHS, CURVATURE = 26, (0.6, 1.4), 0.36


def write(name, points, triangles, digits):
    def numbers(values):
        return " ".join("%.*f" % (digits, value) for value in values)

    lines = ['Shape "loopsubdiv" "integer levels" 2', '  "integer indices" [']
    # The normals of loopsubdiv are on the side from which triangles run clockwise, as in pbrt-v4.
    lines += ["%d %d %d" % (a, c, b) for a, b, c in triangles]
    lines += [']  "point3 P" ['] + [numbers(point) for point in points] + ["]"]
    path = os.path.join(HERE, "subdivision", name + ".pbrt.gz")
    with open(path, "wb") as file, gzip.GzipFile("", "wb", 9, file, 0) as packed:
        packed.write(("\n".join(lines) + "\n").encode())
    print("%s: %d triangles, %d bytes" % (path, len(triangles), os.path.getsize(path)))


def turned(profile):
    """The closed mesh of a profile turned about the y axis; normals point outwards."""
    rings = profile[1:-1]
    points = [(0, profile[0][1], 0)]
    for radius, height in rings:
        for step in range(AROUND):
            angle = 2 * math.pi * step / AROUND
            points.append((radius * math.cos(angle), height, radius * math.sin(angle)))
    points.append((0, profile[-1][1], 0))

    def vertex(ring, step):
        return 1 + ring * AROUND + step % AROUND

    triangles = []
    for step in range(AROUND):
        triangles.append((0, vertex(0, step), vertex(0, step + 1)))
        for ring in range(len(rings) - 1):
            a, b = vertex(ring, step), vertex(ring + 1, step)
            c, d = vertex(ring + 1, step + 1), vertex(ring, step + 1)
            triangles += [(a, b, c), (a, c, d)]
        triangles.append((vertex(len(rings) - 1, step), len(points) - 1,
                          vertex(len(rings) - 1, step + 1)))
    return points, triangles


def water():
    """Waves about height 0; normals point up."""
    chance = random.Random(3)
    waves = []
    for _ in range(WAVES):
        number = 2 * math.pi / chance.uniform(*LENGTHS)
        angle = chance.gauss(0.9, 0.9)
        waves.append((number * math.cos(angle), number * math.sin(angle),
                      chance.uniform(0, 2 * math.pi), CURVATURE / number ** 2))

    def grid(bounds):
        count = math.ceil((bounds[1] - bounds[0]) / SPACING)
        return [bounds[0] + (bounds[1] - bounds[0]) * i / count for i in range(count + 1)]

    xs, zs = grid(WATER_X), grid(WATER_Z)
    points = [(x, sum(height * math.sin(kx * x + kz * z + phase)
                      for kx, kz, phase, height in waves), z) for z in zs for x in xs]
    triangles = []
    for row in range(len(zs) - 1):
        for column in range(len(xs) - 1):
            a = row * len(xs) + column
            b, c, d = a + len(xs), a + len(xs) + 1, a + 1
            triangles += [(a, b, c), (a, c, d)]
    return points, triangles


def main():
    write("goblet", *turned(GOBLET), 5)
    write("wine", *turned(WINE), 5)
    write("water", *water(), 4)


if __name__ == "__main__":
    main()
