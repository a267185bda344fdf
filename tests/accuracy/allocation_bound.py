#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Upper bound on the gain of distributing samples over the parts of an image.

    SHEAF_BIN=build/release/bin tests/accuracy/allocation_bound.py SCENE... [--samples 64]
        [--images 4] [--cells 8,16,32] [--reference-samples 4096] [--references FOLDER]
        [--crop X0,Y0,X1,Y1]

Let k be the squared error of a cell of pixels at one sample, and c the cost of a sample in it. A
uniform image of some error costs mean(k) mean(c), and one with n samples in each cell costs
mean(k / n) mean(c n), which is least for n = sqrt(k / c): mean(sqrt(k c))^2 (Cauchy and Schwarz;
Neyman 1934). The ratio of the two is the maximum that adaptive_gain.py can measure with those
cells.

For every scene it renders a reference to measure errors against, and some images with a farm of one
worker. k is computed from their standard errors, c from the CPU time of tiles as small as the
smallest cells. Prints for each cell size:

    bound   with k and c of all images together: chance variation usually makes it too large
    known   samples distributed by one image alone, k and c estimated from the others: the gain of
            a rule that has seen as many samples
    errors  the same, distributed by k alone, since costs are times that differ between farms

Needs python3-numpy and python3-openimageio.
"""
import contextlib
import os
import sqlite3
import statistics
import sys
import tempfile

import numpy
import OpenImageIO

import target_error

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "integration"))
import farm  # noqa: E402

# As in sample_rounds.cc: a rare event may not have happened in a cell yet.
CELL_SHARE_MIN = 0.01


def read_channels(path, names):
    """Planes [height][width] of the image's window, and that window's corner."""
    image = OpenImageIO.ImageBuf(path)
    spec = image.spec()
    pixels = image.get_pixels(OpenImageIO.FLOAT).astype(numpy.float64)
    return [pixels[:, :, spec.channelnames.index(name)] for name in names], (spec.x, spec.y)


def cell_means(plane, corner, size):
    """Means over cells on a grid of the uncropped frame, and their pixel counts."""
    sums, counts = {}, {}
    height, width = plane.shape
    for y in range(height):
        cells = (numpy.arange(width) + corner[0]) // size
        for cell in numpy.unique(cells):
            row = plane[y, cells == cell]
            key = ((y + corner[1]) // size, cell)
            sums[key] = sums.get(key, 0) + row.sum()
            counts[key] = counts.get(key, 0) + row.size
    keys = sorted(sums)
    return (numpy.array([sums[key] / counts[key] for key in keys]),
            numpy.array([counts[key] for key in keys]))


class Image:
    """Planes of k, a pixel's squared relative error, and of c, its CPU seconds."""

    def __init__(self, path, tile_costs, reference):
        errors, self.corner = read_channels(path, [f"stderr.{c}" for c in "RGB"])
        truth, _ = read_channels(reference, "RGB")
        least = (0.1 * numpy.mean(truth)) ** 2
        self.errors = sum(e ** 2 / (t ** 2 + least) for e, t in zip(errors, truth)) / 3
        self.costs = numpy.zeros_like(self.errors)
        for x0, y0, x1, y1, seconds in tile_costs:
            self.costs[y0 - self.corner[1]:y1 - self.corner[1],
                       x0 - self.corner[0]:x1 - self.corner[0]] = seconds / (x1 - x0) / (y1 - y0)


def render_images(scene, options, reference, folder):
    images = []
    with farm.Farm() as one:
        one.start_worker(threads=1)
        for seed in range(1, options.images + 1):  # The farm numbers its jobs alike.
            path = os.path.join(folder, f"{seed}.exr")
            one.sheaf("submit", scene, "--wait", "--samples", options.samples, "--tile-size",
                      min(options.cells), "--seed", seed, "-o", path,
                      *target_error.crop_flags(options))
            with contextlib.closing(sqlite3.connect(
                    f"file:{one.path('state', 'farm.db')}?mode=ro", uri=True)) as database:
                costs = database.execute(
                    "SELECT x0, y0, x1, y1, SUM(cpu_ns) / 1e9 FROM parts WHERE job_id = ? "
                    "GROUP BY y0, x0, y1, x1", (seed,)).fetchall()
            images.append(Image(path, costs, reference))
    return images


def saving(errors, costs, weights, samples):
    """Cost of uniform samples over the cost of these samples, for the same error."""
    def mean(values):
        return numpy.average(values, weights=weights)
    return mean(errors) * mean(costs) / mean(errors / samples) / mean(costs * samples)


def shares(errors, costs):
    return numpy.sqrt(numpy.maximum(errors, CELL_SHARE_MIN * errors.mean()) / costs)


def savings(images, size):
    """Bound, known and errors, as defined above."""
    corner = images[0].corner
    means = [(cell_means(p.errors, corner, size)[0], cell_means(p.costs, corner, size)[0])
             for p in images]
    weights = cell_means(images[0].errors, corner, size)[1]
    every = [sum(m[i] for m in means) / len(means) for i in (0, 1)]
    bound = saving(*every, weights, numpy.sqrt(every[0] / every[1] + 1e-300))
    known, by_errors = [], []
    for one in means:
        rest = [(every[i] * len(means) - one[i]) / (len(means) - 1) for i in (0, 1)]
        known.append(saving(*rest, weights, shares(*one)))
        by_errors.append(saving(*rest, weights, shares(one[0], numpy.ones_like(one[1]))))
    return bound, statistics.mean(known), statistics.mean(by_errors)


def main():
    parser = target_error.make_parser(__doc__, target_error.REFERENCE_SAMPLES_MIN)
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--images", type=int, default=4)
    parser.add_argument("--cells", default="8,16,32")
    options = parser.parse_args()
    options.cells = [int(size) for size in options.cells.split(",")]
    found = {size: [] for size in options.cells}
    for scene in options.scenes:
        with tempfile.TemporaryDirectory() as folder:
            reference, _ = target_error.make_reference(
                scene, options, folder, target_error.reference_samples(scene, options))
            images = render_images(scene, options, reference, folder)
        for size in options.cells:
            found[size].append(savings(images, size))
        print(f"{os.path.basename(scene)}: " + "; ".join(
            f"cells of {size}: bound {found[size][-1][0]:.2f}, known {found[size][-1][1]:.2f}, "
            f"errors {found[size][-1][2]:.2f}" for size in options.cells), flush=True)
    for size in options.cells:
        bound, known, errors = (statistics.median(column) for column in zip(*found[size]))
        print(f"{len(options.scenes)} scenes, cells of {size}: bound {bound:.2f}, known "
              f"{known:.2f}, errors {errors:.2f} in the median")


if __name__ == "__main__":
    main()
