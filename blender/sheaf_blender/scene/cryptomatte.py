# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Cryptomatte: ids of names, and mattes whose names become Blender's.

Source: Friedman and Jones, "Cryptomatte specification" 1.2 (Psyop): MurmurHash3 (x86, 32 bits) of
the name in UTF-8, as a float that is neither denormal, infinite nor NaN.
"""
import struct

import numpy

_MASK = 0xFFFFFFFF


def _rotate(x, bits):
    return ((x << bits) | (x >> (32 - bits))) & _MASK


def murmur3(data):
    h = 0
    blocks = len(data) // 4
    for i in range(blocks):
        k = struct.unpack_from("<I", data, 4 * i)[0]
        k = _rotate(k * 0xCC9E2D51 & _MASK, 15) * 0x1B873593 & _MASK
        h = (_rotate(h ^ k, 13) * 5 + 0xE6546B64) & _MASK
    tail = int.from_bytes(data[4 * blocks:], "little")
    if len(data) % 4:
        h ^= _rotate(tail * 0xCC9E2D51 & _MASK, 15) * 0x1B873593 & _MASK
    h ^= len(data)
    h = (h ^ (h >> 16)) * 0x85EBCA6B & _MASK
    h = (h ^ (h >> 13)) * 0xC2B2AE35 & _MASK
    return h ^ (h >> 16)


def id_bits(name):
    """The bits of the float that stands for the name."""
    bits = murmur3(name.encode("utf-8"))
    if (bits >> 23) & 0xFF in (0, 0xFF):
        bits ^= 1 << 23
    return bits


def renamed(levels, names):
    """levels: (height, width, 4) float32 arrays of ids and coverages; names: {Sheaf's name: new}.

    Returns the levels with the ids of the new names; ids without a new name stay.
    """
    if not names:
        return levels
    old = numpy.array([id_bits(name) for name in names], numpy.uint32)
    new = numpy.array([id_bits(name) for name in names.values()], numpy.uint32)
    order = numpy.argsort(old)
    old, new = old[order], new[order]
    result = []
    for level in levels:
        level = numpy.array(level, numpy.float32)
        for channel in (0, 2):
            bits = numpy.ascontiguousarray(level[..., channel]).view(numpy.uint32)
            place = numpy.minimum(numpy.searchsorted(old, bits), len(old) - 1)
            bits = numpy.where(old[place] == bits, new[place], bits)
            level[..., channel] = bits.view(numpy.float32)
        result.append(level)
    return result
