# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Compares two images of one scene: their difference, and whether noise explains it.

    python3 compare_images.py A.exr B.exr

`sheaf compare` does this with a proper test; here one sees how to use the layers.
"""
import sys

import numpy

import sheaf


def main(first: str, second: str) -> None:
    a, b = sheaf.read_image(first), sheaf.read_image(second)
    difference = a.rgb - b.rgb
    deviation = numpy.sqrt(a.error**2 + b.error**2)  # For the difference of independent images.
    noisy = deviation > 0
    ratio = numpy.abs(difference[noisy]) / deviation[noisy]
    print(f"means {a.rgb.mean():.6g} and {b.rgb.mean():.6g}")
    print(f"root mean square of the difference {numpy.sqrt((difference**2).mean()):.3g}, expected "
          f"from noise {numpy.sqrt((deviation**2).mean()):.3g}")
    print(f"{(ratio < 3).mean():.2%} of the values differ by less than three standard errors")


if __name__ == "__main__":
    main(*sys.argv[1:])
