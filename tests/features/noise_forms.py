# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Perlin's gradient noise and pbrt-v4's patterns of it, written from their papers for arrays."""
import numpy as np

# Perlin 2002, "Improving noise": the order of 0 to 255 that his reference publishes.
ORDER = np.frombuffer(bytes.fromhex(
    "97a0895b5a0f830dc95f6035c2e907e18c24671e458e086325f0150a17be0694f778ea4b001ac53e5efcdbcb"
    "75230b2039b12158ed953857ae147d88aba844af4aa547868b301ba64d929ee7536fe57a3cd385e6dc695c29"
    "372ef528f4668f3641193fa101d85049d14c84bbd05912a9c8c4878274bc9f56a4646dc6adba034034d9e2fa"
    "7c7b05ca2693767eff5255d4cfce3be32f103a11b6bd1c2adfb7aad577f898022c9aa346dd99659ba72bac09"
    "811627fd13626c6e4f71e0e8b2b97068daf661e4fb22f2c1eed2900cbfb3a2f1513391ebf90eef6b31c0d61f"
    "b5c76a9db854ccb07379322d7f0496fe8aeccd5dde72431d1848f38d80c34e42d73d9cb4"), dtype=np.uint8
).astype(int)
# The gradients of pbrt-v4's 16 hashes, as (x, y, z).
GRADIENTS = np.array(
    [(1, 1, 0), (-1, 1, 0), (1, -1, 0), (-1, -1, 0), (1, 0, 1), (-1, 0, 1), (1, 0, -1),
     (-1, 0, -1), (0, 1, 1), (0, -1, 1), (0, 1, -1), (0, -1, -1), (1, 1, 0), (-1, 1, 0),
     (0, 1, -1), (0, -1, -1)])
MARBLE = np.array([(.58, .58, .6)] * 3 + [(.5, .5, .5), (.6, .59, .58), (.58, .58, .6),
                                          (.58, .58, .6), (.2, .2, .33), (.58, .58, .6)])


def noise(p):
    cell = np.floor(p).astype(int)
    inside = p - cell
    fade = inside ** 3 * (inside * (inside * 6 - 15) + 10)
    total = 0
    for corner in np.ndindex(2, 2, 2):
        hashed = 0
        for axis in range(3):
            hashed = ORDER[(hashed + cell[..., axis] + corner[axis]) & 255]
        product = (GRADIENTS[hashed & 15] * (inside - corner)).sum(axis=-1)
        total = total + product * np.where(corner, fade, 1 - fade).prod(axis=-1)
    return total


def octaves(p, count, roughness, of):
    return sum(roughness ** i * of(noise(p * 1.99 ** i)) for i in range(count))


def fbm(p, count=8, roughness=.5):
    return octaves(p, count, roughness, np.array)


def turbulence(p, count=8, roughness=.5):
    return octaves(p, count, roughness, np.abs)


def marble(p, variation):
    along = (.5 + .5 * np.sin(p[..., 1] + variation * fbm(p))) * 6
    first = np.minimum(np.floor(along).astype(int), 5)
    t = (along - first)[..., None]
    weights = ((1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t ** 3)
    return 1.5 * sum(w * MARBLE[first + i] for i, w in enumerate(weights))


def dots(s, t):
    """Whether each point is in a disc."""
    def plane(a, b):
        return noise(np.stack([a, b, np.full_like(a, .5)], axis=-1))
    cell_s, cell_t = np.floor(s + .5), np.floor(t + .5)
    off_s = s - cell_s - .15 * plane(cell_s + 1.5, cell_t + 2.8)
    off_t = t - cell_t - .15 * plane(cell_s + 4.5, cell_t + 9.8)
    return (plane(cell_s + .5, cell_t + .5) > 0) & (np.hypot(off_s, off_t) < .35)


def rotated(x, bits):
    return (x << np.uint32(bits)) | (x >> np.uint32(32 - bits))


def hashed(x, y, z):
    """Jenkins' final mix of three keys."""
    seed = np.uint32((0xdeadbeef + (3 << 2) + 13) & 0xffffffff)
    word = {"a": seed + x, "b": seed + y, "c": seed + z}
    for to, by, bits in (("c", "b", 14), ("a", "c", 11), ("b", "a", 25), ("c", "b", 16),
                         ("a", "c", 4), ("b", "a", 14), ("c", "b", 24)):
        word[to] = (word[to] ^ word[by]) - rotated(word[by], bits)
    return word["c"]


def lattice_noise(p):
    """The noise of Blender's nodes, from -1 to 1."""
    cell = np.floor(p)
    inside = p - cell
    fade = inside ** 3 * (inside * (inside * 6 - 15) + 10)
    total = 0
    for corner in np.ndindex(2, 2, 2):
        keys = (cell + corner).astype(np.int64).astype(np.uint32)
        h = hashed(keys[..., 0], keys[..., 1], keys[..., 2]) & np.uint32(15)
        x, y, z = np.moveaxis(inside - corner, -1, 0)
        u = np.where(h < 8, x, y)
        v = np.where(h < 4, y, np.where((h == 12) | (h == 14), x, z))
        product = np.where(h & 1, -u, u) + np.where(h & 2, -v, v)
        total = total + product * np.where(corner, fade, 1 - fade).prod(axis=-1)
    return .9820 * total
