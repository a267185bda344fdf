#!/usr/bin/python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Makes the meshes, textures and environment map of the scenes here, and the turntable's frames.

Needs python3-numpy and python3-openimageio. The outputs are committed; run it again after a change:
    /usr/bin/python3 scenes/make_assets.py
"""
import os

import numpy as np
import OpenImageIO as oiio

HERE = os.path.dirname(os.path.abspath(__file__))
RANDOM = np.random.default_rng(7)
TURNTABLE_FRAMES = 24


def path(*names):
    return os.path.join(HERE, *names)


# Meshes -----------------------------------------------------------------------------------------


def write_ply(file_path, positions, normals, uvs, triangles):
    """Binary little-endian PLY with float positions, normals, uvs and triangles."""
    vertices = np.concatenate([positions, normals, uvs], axis=1).astype("<f4")
    faces = np.empty(len(triangles), dtype=[("count", "u1"), ("index", "<i4", 3)])
    faces["count"] = 3
    faces["index"] = triangles
    names = "x y z nx ny nz u v".split()
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}",
              *(f"property float {name}" for name in names), f"element face {len(faces)}",
              "property list uchar int vertex_indices", "end_header", ""]
    with open(file_path, "wb") as file:
        file.write("\n".join(header).encode())
        file.write(vertices.tobytes())
        file.write(faces.tobytes())


def grid_mesh(file_path, surface, count_u, count_v):
    """A mesh over surface(u, v) -> [..., 3] with u, v in [0, 1], smooth normals by differences.

    The outside is where the cross product of the derivatives by u and v points.
    """
    u, v = np.meshgrid(np.linspace(0, 1, count_u + 1), np.linspace(0, 1, count_v + 1))
    step = 1e-5
    along_u = surface(u + step, v) - surface(u - step, v)
    along_v = surface(u, v + step) - surface(u, v - step)
    normals = np.cross(along_u, along_v)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-30)
    index = np.arange((count_u + 1) * (count_v + 1)).reshape(count_v + 1, count_u + 1)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    triangles = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3),
                                np.stack([a, c, d], -1).reshape(-1, 3)])
    positions = surface(u, v).reshape(-1, 3)
    # A pole has triangles without area.
    corners = positions[triangles]
    edges = corners[:, 1:] - corners[:, :1]
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    write_ply(file_path, positions, normals.reshape(-1, 3), np.stack([u, v], -1).reshape(-1, 2),
              triangles[area > 1e-12])


def torus_knot(u, v):
    """A (2, 3) torus knot as a tube, about 2 high, its axis along z."""
    def centre(s):
        t = 2 * np.pi * s
        r = 0.62 + 0.26 * np.cos(3 * t)
        return np.stack([r * np.cos(2 * t), r * np.sin(2 * t), 0.3 * np.sin(3 * t)], -1)

    tangent = centre(u + 1e-4) - centre(u - 1e-4)
    tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
    # The direction from the torus' core circle keeps the frame free of twist jumps.
    t = 2 * np.pi * u
    outwards = np.cos(3 * t)
    radial = np.stack([outwards * np.cos(2 * t), outwards * np.sin(2 * t), np.sin(3 * t)], -1)
    radial -= tangent * np.sum(radial * tangent, -1, keepdims=True)
    radial /= np.linalg.norm(radial, axis=-1, keepdims=True)
    side = np.cross(tangent, radial)
    angle = -2 * np.pi * v[..., None]
    return centre(u) + 0.135 * (np.cos(angle) * radial + np.sin(angle) * side)


def lathe(profile):
    """Turns profile(v) -> (radius, height) about the y axis."""
    def surface(u, v):
        radius, height = profile(v)
        angle = -2 * np.pi * u
        return np.stack([radius * np.cos(angle), height, radius * np.sin(angle)], -1)

    return surface


def podium_profile(v):
    """A low drum of radius 3.1 and height 0.22 with a rounded edge, top centre last."""
    edge = 0.08
    corner = np.clip((v - 0.3) / 0.4, 0, 1) * np.pi / 2
    radius = 3.1 - edge + edge * np.cos(corner)
    height = 0.22 - edge + edge * np.sin(corner)
    height = np.where(v < 0.3, (0.22 - edge) * v / 0.3, height)
    radius = np.where(v > 0.7, (3.1 - edge) * (1 - v) / 0.3, radius)
    return radius, height


def rim_profile(v):
    """The turntable's metal edge: a rounded band of radius 1.5 below height 0."""
    angle = np.pi * (v - 0.5)
    return 1.48 + 0.08 * np.cos(angle), -0.1 + 0.11 * np.sin(angle)


def cove(u, v):
    """A studio's backdrop: floor, a quarter of a circle, and wall."""
    x = 14 * (1 - 2 * u)
    floor, turn, wall = 18.0, 3.5 * np.pi / 2, 9.0
    s = v * (floor + turn + wall)
    angle = np.clip((s - floor) / 3.5, 0, np.pi / 2)
    z = -13 + np.minimum(s, floor) + 3.5 * np.sin(angle)
    y = 3.5 * (1 - np.cos(angle)) + np.maximum(s - floor - turn, 0)
    return np.stack([x, y, z], -1)


def vase(u, v):
    """A twisted, fluted vase of height 2.2, outside from the foot up and inside down again."""
    up = np.clip(v / 0.62, 0, 1)
    down = np.clip((v - 0.66) / 0.34, 0, 1)
    h = np.where(v < 0.64, up, 1 - down * 0.93)
    body = 0.34 + 0.46 * np.sin(np.pi * h ** 0.8) ** 1.4 + 0.16 * h ** 6
    flutes = 0.055 * np.sin(np.pi * np.clip(h * 1.02, 0, 1)) ** 0.6
    angle = -2 * np.pi * u
    lobes = np.abs(np.cos(6 * (angle + 1.1 * h))) ** 0.9
    radius = body - flutes * (1 - lobes)
    inside = np.clip((v - 0.62) / 0.04, 0, 1)
    radius = (radius - 0.05 * inside) * np.where(v > 0.97, np.clip((1 - v) / 0.03, 0, 1), 1)
    radius = radius * np.where(v < 0.02, v / 0.02, 1)
    lip = 0.025 * np.sin(np.pi * np.clip((v - 0.6) / 0.08, 0, 1))
    height = np.where(v < 0.02, 0, 2.2 * h) + lip
    return np.stack([radius * np.cos(angle), height, radius * np.sin(angle)], -1)


# Images ---------------------------------------------------------------------------------------


def write_image(file_path, pixels, pixel_type):
    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, pixel_type)
    spec.attribute("compression", "zip")
    # Otherwise the time of writing, and no two runs would give the same bytes.
    spec.attribute("DateTime", "2026:01:01 00:00:00")
    output = oiio.ImageOutput.create(file_path)
    output.open(file_path, spec)
    output.write_image(np.ascontiguousarray(pixels, dtype=np.float32))
    output.close()


def smooth_noise(size, cells):
    """Periodic value noise over a square of size x size in [0, 1]; cells is (rows, columns)."""
    grid = RANDOM.random(cells)
    y, x = [np.linspace(0, n, size, endpoint=False) for n in cells]
    y0, x0 = y.astype(int), x.astype(int)
    fy, fx = [(t - np.floor(t)) ** 2 * (3 - 2 * (t - np.floor(t))) for t in (y, x)]

    def at(dy, dx):
        return grid[np.ix_((y0 + dy) % cells[0], (x0 + dx) % cells[1])]

    top = at(0, 0) * (1 - fx) + at(0, 1) * fx
    bottom = at(1, 0) * (1 - fx) + at(1, 1) * fx
    return top * (1 - fy[:, None]) + bottom * fy[:, None]


def mix(a, b, t):
    return np.asarray(a) * (1 - t[..., None]) + np.asarray(b) * t[..., None]


def wood():
    """Walnut rings along u, as sRGB."""
    size = 384
    v = np.linspace(0, 1, size, endpoint=False)[:, None]
    bend = smooth_noise(size, (4, 3)) * 0.9 + smooth_noise(size, (8, 6)) * 0.25
    rings = 0.5 + 0.5 * np.sin(2 * np.pi * (9 * v + bend))
    grain = smooth_noise(size, (192, 6)) * 0.6 + smooth_noise(size, (96, 4)) * 0.4
    tone = np.clip(0.55 * rings ** 1.6 + 0.5 * grain, 0, 1)
    return mix([0.30, 0.18, 0.11], [0.60, 0.40, 0.25], tone)


def globe():
    """Islands in a sea for a sphere, as sRGB; rows from pole to pole."""
    size = 384
    height = sum(smooth_noise(size, (3 << i, 5 << i)) / 2 ** i for i in range(5))
    height = (height - height.min()) / np.ptp(height)
    shore = np.clip((height - 0.52) / 0.015, 0, 1)
    land = mix([0.80, 0.70, 0.45], [0.28, 0.45, 0.24], np.clip((height - 0.53) / 0.12, 0, 1))
    land = land * (1 - np.clip((height - 0.7) / 0.1, 0, 1))[..., None] \
        + np.array([0.93, 0.93, 0.9]) * np.clip((height - 0.7) / 0.1, 0, 1)[..., None]
    sea = mix([0.05, 0.16, 0.33], [0.14, 0.42, 0.55], np.clip(height / 0.52, 0, 1) ** 3)
    return sea * (1 - shore[..., None]) + land * shore[..., None]


def equal_area_directions(size):
    """Direction of each pixel of an equal-area octahedral map, z up.

    Source: Clarberg 2008, "Fast Equal-Area Mapping of the (Hemi)Sphere using SIMD".
    """
    centre = (np.arange(size) + 0.5) / size * 2 - 1
    u, v = np.meshgrid(centre, centre)
    signed = 1 - (np.abs(u) + np.abs(v))
    r = 1 - np.abs(signed)
    phi = ((np.abs(v) - np.abs(u)) / np.maximum(r, 1e-9) + 1) * np.pi / 4
    ring = r * np.sqrt(2 - r * r)
    return np.stack([np.copysign(np.cos(phi), u) * ring, np.copysign(np.sin(phi), v) * ring,
                     np.copysign(1 - r * r, signed)], -1)


def softbox(directions, towards, half_width, half_height, soft):
    """Coverage of a rectangular light in a direction: 1 inside, falling to 0 over `soft`."""
    forward = np.asarray(towards, float)
    forward /= np.linalg.norm(forward)
    side = np.cross([0, 1, 0], forward)
    side /= np.linalg.norm(side)
    above = np.cross(forward, side)
    along = directions @ forward
    x = (directions @ side) / np.maximum(along, 1e-3)
    y = (directions @ above) / np.maximum(along, 1e-3)
    edge = np.maximum(np.abs(x) - half_width, np.abs(y) - half_height)
    return np.where(along > 0.05, np.clip(0.5 - edge / soft, 0, 1), 0)


def studio():
    """A studio's lights around the scene: radiance by direction, in the scene's y-up space."""
    light = equal_area_directions(256)
    # The scene turns the map by -90 degrees about x: its z is up there.
    world = np.stack([light[..., 0], light[..., 2], -light[..., 1]], -1)
    height = world[..., 1]
    sky = mix([0.20, 0.17, 0.15], [0.30, 0.36, 0.46], np.clip(height * 0.5 + 0.5, 0, 1))
    key = softbox(world, (-1.0, 0.95, -0.75), 0.42, 0.55, 0.08)
    rim = softbox(world, (1.25, 0.45, 0.25), 0.16, 0.75, 0.06)
    fill = softbox(world, (0.9, 0.5, -1.0), 0.5, 0.3, 0.25)
    top = softbox(world, (0.1, 1.0, 0.25), 0.75, 0.32, 0.1)
    return sky + key[..., None] * [13, 11.6, 9.6] + rim[..., None] * [7.5, 9, 12] \
        + fill[..., None] * [1.6, 1.7, 2.0] + top[..., None] * [4.2, 4.0, 3.7]


# Frames -----------------------------------------------------------------------------------------

FRAME = """# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
# Frame {number} of {count}; written by make_assets.py.
Include "camera.pbrt"
Film "rgb" "integer xresolution" 320 "integer yresolution" 180
  "string filename" "turntable.{number:04d}.exr"
WorldBegin
Include "studio.pbrt"
AttributeBegin
  Rotate {angle:g} 0 1 0
  Include "vase.pbrt"
AttributeEnd
"""


def write_turntable():
    for number in range(1, TURNTABLE_FRAMES + 1):
        angle = (number - 1) * 360 / TURNTABLE_FRAMES
        with open(path("turntable", f"turntable.{number:04d}.pbrt"), "w", encoding="utf-8") as file:
            file.write(FRAME.format(number=number, count=TURNTABLE_FRAMES, angle=angle))


def main():
    grid_mesh(path("showroom", "knot.ply"), torus_knot, 420, 30)
    grid_mesh(path("showroom", "podium.ply"), lathe(podium_profile), 180, 40)
    grid_mesh(path("showroom", "cove.ply"), cove, 1, 72)
    grid_mesh(path("turntable", "rim.ply"), lathe(rim_profile), 180, 12)
    grid_mesh(path("turntable", "vase.ply"), vase, 192, 120)
    write_image(path("showroom", "wood.png"), wood(), oiio.UINT8)
    write_image(path("showroom", "globe.png"), globe(), oiio.UINT8)
    write_image(path("showroom", "studio.exr"), studio(), oiio.HALF)
    write_turntable()


if __name__ == "__main__":
    main()
