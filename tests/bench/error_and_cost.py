# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The error and the CPU seconds of images, as several benches measure them.

Errors are relMSE against an image of more samples, of all pixels, and without the worst: fireflies,
and edges of lamps in view, are rare events that decide the relMSE of few samples by chance. CPU
seconds are those of the frame's tasks on one thread, with training, without loading.

Needs Debian's python3-openimageio and python3-numpy.
"""
import json
import os
import statistics
import subprocess
import sys
from typing import NamedTuple

import numpy
import OpenImageIO as oiio

from technique_regions import DARK

REFERENCE_SEED = 1000
WORST = 0.01  # Fraction of the pixels that is left out.


class Measured(NamedTuple):
    """Means over seeds."""
    error: float          # relMSE of all pixels.
    trimmed_error: float  # Without the worst.
    cpu_seconds: float


def render(sheaf, scene, path, samples, seed, *arguments):
    """The CPU seconds of the frame."""
    command = [sheaf, "render", scene, "-o", path, "--samples", samples, "--seed", seed,
               "--threads", 1, "--json", *arguments]
    done = subprocess.run([str(a) for a in command], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}: {done.stderr}")
    return json.loads(done.stdout.splitlines()[-1])["progress"]["cpu_duration_seconds"]


def colors(path):
    """R, G and B of all views, side by side."""
    image = oiio.ImageBuf(path)
    names = image.spec().channelnames
    pixels = image.get_pixels(oiio.FLOAT).astype(numpy.float64)
    views = [view for view in ("", "right.") if view + "R" in names]
    return numpy.hstack([numpy.stack([pixels[..., names.index(view + c)] for c in "RGB"], axis=-1)
                         for view in views])


def errors_of(image, reference):
    """relMSE of all pixels, and without the worst."""
    least = DARK * reference.mean(axis=(0, 1))
    relative = (image - reference) ** 2 / numpy.maximum(reference, least) ** 2
    errors = numpy.sort(relative.mean(axis=-1).ravel())
    return errors.mean(), errors[:round(len(errors) * (1 - WORST))].mean()


def measure(options, scene, folder, reference_times, reference_arguments, choices):
    """Measured of each of `choices`, which are arguments of `sheaf render`. options: the bench's
    (sheaf, samples, seeds). The reference has reference_times the samples."""
    path, reference = (os.path.join(folder, name) for name in ("image.exr", "reference.exr"))
    render(options.sheaf, scene, reference, reference_times * options.samples, REFERENCE_SEED,
           *reference_arguments)
    expected = colors(reference)
    found = []
    for arguments in choices:
        rows = []
        for seed in range(options.seeds):
            cpu_seconds = render(options.sheaf, scene, path, options.samples, seed, *arguments)
            rows.append((*errors_of(colors(path), expected), cpu_seconds))
        found.append(Measured(*(statistics.mean(column) for column in zip(*rows))))
    return found
