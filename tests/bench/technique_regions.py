#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Prints what a choice of techniques by region could gain over a choice by frame, as a table.

    tests/bench/technique_regions.py SHEAF [SCENE ...] [--width 128] [--samples 128] [--halves 2]
                                     [--cost rays|cpu] [--outliers 0] [--pairs] [--threads 1]
                                     [--keep FOLDER]

SHEAF is a build's program `sheaf`. Renders small images of each scene by each choice of techniques,
several times with independent seeds (halves). The renderer counts rays (or CPU time) for each tile
of 8 x 8 pixels, for the light passes and for the training; error bars give the variance of a sample
in each pixel. From these numbers the script computes error times cost of mixed frames, in which
each region has techniques of its own:

  - Camera samples of a region cost and vary as in the frame of the region's techniques.
  - The paths of light passes cost the same wherever they are used. Their connections to regions
    without light paths cost nothing; a crop of one pixel tells the cost of the paths alone.
    Connections count as spread evenly over the frame.
  - The training costs the same if any region is guided.

Error is relMSE against the mean of the images with light paths. Frames without light paths have
LONGER times the samples, as they find some light rarely. Where they miss light, their squared
difference counts as variance if it is larger than that of the error bars.

Columns:

  - `connections`: their part of the cost of light paths.
  - `frame`: the techniques that are best for the whole frame, by each half.
  - `samples`: `uniform`: each pixel has as many; `adaptive`: each region has the number that is
    best for it, in frames too.
  - `best`: what each half gains on its own data. 1.10 means that the frame costs a tenth more than
    the regions for the same error. It is too good, because it follows the noise.
  - `real`: regions and frame choose from one half, and the others judge; a small image before the
    frame can do that. Choices are by rays, whatever the cost that judges.
  - `calm`: as `real`, where a region leaves the frame's techniques only for a gain of a quarter.
  - `safe`: as `real`, but where the frame has light paths, all regions have them.
  - `floor`: `safe` against the techniques of the frame that turn out best, so that a wrong choice
    by frame is no gain of the regions.
  - `adapting`: what the best frame gains by adaptive samples.
  - `area`: what `safe` gives to each choice of techniques.

Scenes of SHEAF_PUBLIC_SCENES are added if it is set. Needs Debian's python3-openimageio and
python3-numpy.
"""
import argparse
import contextlib
import dataclasses
import itertools
import json
import os
import re
import sqlite3
import subprocess
import sys
import tempfile

import numpy
import OpenImageIO as oiio

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
SCENES = ["caustic", "ajar", "pool", "frosted", "showroom", "cornell-box", "fog-room"]
PUBLIC = {
    "cornell-box (public)": "cornell-box/cornell-box-small.pbrt",
    "cornell-box-specular": "cornell-box/cornell-box-specular-small.pbrt",
    "veach-mis": "veach-mis/veach-mis-small.pbrt",
    "killeroo-simple": "killeroos/killeroo-simple-small.pbrt",
    "staircase2": "staircase2/staircase2-small.pbrt",
}
SETS = ("camera", "camera+light", "camera+guiding", "camera+light+guiding")
LIGHT = numpy.array(["light" in name for name in SETS])
GUIDED = numpy.array(["guiding" in name for name in SETS])
TILE_PX = 8
REGIONS_PX = (8, 16, 32)
DARK = 0.1  # Dark pixels count against this fraction of the mean, as in relMSE.
LONGER = 4  # Times the samples, without light paths.
FRAME_SAMPLES = 256  # In the frame that pays for the training.
CALM = 1.25
PASSES = 16  # In the image that tells the cost of light paths without connections.
# Numbers of the column `kind` of the table `parts`.
KIND_TILE, KIND_LIGHT, KIND_TRAINING = 0, 1, 2
# Prices of cost in error among which an assignment's is searched, relative to the frame's.
PRICES = numpy.geomspace(1 / 64, 64, 49)


@dataclasses.dataclass
class Render:
    """One image. Costs are those of a sample of each pixel, or of a light pass."""
    color: numpy.ndarray           # [y, x, channel]
    variance: numpy.ndarray        # For a camera sample, by pixel and channel.
    light_variance: numpy.ndarray  # For a light pass.
    tile_cost: numpy.ndarray       # [tile y, tile x]
    light_cost: float              # With connections to all pixels.
    training_cost: float           # For the whole training.
    samples: int


@dataclasses.dataclass
class Regions:
    """The data that a choice needs, by set of techniques and region."""
    error: numpy.ndarray        # [set, region]: sums of relative variances of a camera sample.
    light_error: numpy.ndarray  # For a light pass.
    cost: numpy.ndarray         # For a camera sample in each pixel.
    area: numpy.ndarray         # [region], as a fraction of the frame.
    light_cost: float           # For a light pass without connections.
    connection_cost: float      # For its connections.
    training_cost: float


def run(command):
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)}: {done.stderr}")


def shrink(scene, width, folder):
    """Writes the scene with a film of that width beside links to all that it may refer to."""
    source = os.path.dirname(os.path.abspath(scene))
    for name in os.listdir(source):
        if name != os.path.basename(scene):
            os.symlink(os.path.join(source, name), os.path.join(folder, name))
    text = open(scene, encoding="utf-8").read()
    lines = re.sub(r"#.*", "", text)
    size = [int(re.search(rf'"integer {axis}resolution"\s*\[?\s*(\d+)', lines)[1])
            for axis in "xy"]
    for axis, pixels in zip("xy", (width, round(size[1] * width / size[0]))):
        text = re.sub(rf'("integer {axis}resolution"\s*\[?\s*)\d+', rf"\g<1>{pixels}", text)
    target = os.path.join(folder, os.path.basename(scene))
    with open(target, "w", encoding="utf-8") as file:
        file.write(text)
    return target


def render(options, scene, techniques, samples, seed, base, *crop):
    """Renders to base.exr, and writes the costs of the parts to base.json, unless it is there."""
    if os.path.exists(base + ".json"):
        return
    with tempfile.TemporaryDirectory() as folder:
        state = os.path.join(folder, "state")
        small = shrink(scene, options.width, folder)
        run([options.sheaf, "render", small, "-o", base + ".exr", "--samples", str(samples),
             "--seed", str(seed), "--techniques", techniques, "--threads", str(options.threads),
             "--tile-size", str(TILE_PX), "--keep-state", state, *crop])
        with contextlib.closing(sqlite3.connect(os.path.join(state, "farm.db"))) as farm:
            parts = farm.execute(
                "SELECT kind, y0, x0, ray_count, cpu_ns / 1e9 FROM parts").fetchall()
    with open(base + ".json", "w", encoding="utf-8") as file:
        json.dump([dict(zip(("kind", "y", "x", "rays", "cpu"), part)) for part in parts], file)


def costs_of(base, kind, cost):
    with open(base + ".json", encoding="utf-8") as file:
        return [(part["y"], part["x"], part[cost]) for part in json.load(file)
                if part["kind"] == kind]


def load(base, samples, cost):
    image = oiio.ImageBuf(base + ".exr")
    names = image.spec().channelnames
    pixels = image.get_pixels(oiio.FLOAT).astype(numpy.float64)
    planes = {name: pixels[..., i] for i, name in enumerate(names)}

    def layer(prefix):
        if prefix + "R" not in planes:
            return numpy.zeros(pixels.shape[:2] + (3,))
        return numpy.stack([planes[prefix + c] for c in "RGB"], axis=-1)

    light_variance = layer("light.stderr.") ** 2 * samples
    tile_cost = numpy.zeros([-(-size // TILE_PX) for size in pixels.shape[:2]])
    for y, x, value in costs_of(base, KIND_TILE, cost):
        tile_cost[y // TILE_PX, x // TILE_PX] += value / samples
    light_cost, training_cost = (sum(value for _, _, value in costs_of(base, kind, cost))
                                 for kind in (KIND_LIGHT, KIND_TRAINING))
    return Render(color=layer(""), light_variance=light_variance,
                  variance=numpy.maximum(layer("stderr.") ** 2 * samples - light_variance, 0),
                  tile_cost=tile_cost, light_cost=light_cost / samples,
                  training_cost=training_cost, samples=samples)


def render_halves(options, name, scene, folder, cost):
    """Lists of renders by set, and the cost of a light pass that connects to one pixel."""
    halves = []
    for half in range(options.halves):
        images = []
        for s, techniques in enumerate(SETS):
            # Seeds of their own, or techniques would share their camera paths.
            seed = 10 * (half + 1) + s
            samples = options.samples * (1 if LIGHT[s] else LONGER)
            base = os.path.join(folder, f"{name} {techniques} {samples} {seed}")
            render(options, scene, techniques, samples, seed, base)
            images.append(load(base, samples, cost))
        halves.append(images)
    base = os.path.join(folder, f"{name} paths")
    render(options, scene, "camera+light", PASSES, 1, base, "--crop", "0,0,1,1")
    paths = sum(value for _, _, value in costs_of(base, KIND_LIGHT, cost)) / PASSES
    return halves, paths


def by_region(plane, cells):
    """Sums over squares of cells x cells entries."""
    rows = numpy.add.reduceat(plane, range(0, plane.shape[0], cells), axis=0)
    return numpy.add.reduceat(rows, range(0, plane.shape[1], cells), axis=1).ravel()


def inliers(halves, fraction):
    """1 for each pixel, and 0 for the fraction of them whose variances are the largest."""
    variances = [sum((half[s].variance + half[s].light_variance).mean(axis=-1) for half in halves)
                 for s in range(len(SETS))]
    worst = numpy.max([variance / numpy.median(variance) for variance in variances], axis=0)
    return worst <= numpy.quantile(worst, 1 - fraction)


def regions_of(halves, paths, counts, edge):
    """The mean of some halves, each a list of renders by set. counts: whether a pixel counts."""
    with_light = [half[s] for half in halves for s in range(len(SETS)) if LIGHT[s]]
    truth = sum(image.color for image in with_light) / len(with_light)
    noise = sum((image.variance + image.light_variance) / image.samples
                for image in with_light) / len(with_light) ** 2
    weight = counts / (truth ** 2 + (DARK * truth.mean()) ** 2).mean(axis=-1)

    def error_of(image, s):
        error = by_region(image.variance.mean(axis=-1) * weight, edge)
        if LIGHT[s]:
            return error
        missed = (image.color - truth) ** 2 - noise
        missed = by_region(missed.mean(axis=-1) * weight * image.samples, edge)
        return numpy.maximum(error, missed)

    def mean(value):
        return numpy.array([sum(value(half[s], s) for half in halves) / len(halves)
                            for s in range(len(SETS))])

    area = by_region(numpy.ones(truth.shape[:2]) / truth[..., 0].size, edge)
    return Regions(
        error=mean(error_of), area=area,
        light_error=mean(lambda image, s: by_region(image.light_variance.mean(axis=-1) * weight,
                                                    edge)),
        cost=mean(lambda image, s: by_region(image.tile_cost, edge // TILE_PX)),
        light_cost=paths,
        connection_cost=max(mean(lambda image, s: image.light_cost)[LIGHT].mean() - paths, 0),
        training_cost=mean(lambda image, s: image.training_cost)[GUIDED].mean())


def product(regions, choice, adaptive):
    """Error times cost of a frame whose regions have the sets `choice`."""
    places = numpy.arange(len(choice))
    error, light_error, cost = (values[choice, places] for values in
                                (regions.error, regions.light_error, regions.cost))
    lit = LIGHT[choice]
    light_cost = (regions.light_cost * lit.any() +
                  regions.connection_cost * regions.area[lit].sum())
    training = regions.training_cost * GUIDED[choice].any() / FRAME_SAMPLES
    if adaptive:
        # Counts proportional to sqrt(error / cost) make the product least.
        root = numpy.sqrt(error * cost).sum() + numpy.sqrt(light_error.sum() * light_cost)
        return root ** 2 * (1 + training / (cost.sum() + light_cost))
    return (error + light_error).sum() * (cost.sum() + light_cost + training)


def assignments(regions, adaptive, start, calm, barred_sets):
    """Choices by region, among which the best is: for each list of techniques that the frame may
    use and each price of cost in error, or of light paths' error, the cheapest of each region."""
    whole = (regions.error + regions.light_error).sum(axis=1)[start] / regions.cost[start].sum()
    share = numpy.sqrt((regions.light_cost + regions.connection_cost) /
                       max(regions.light_error[LIGHT].sum(axis=1).mean(), 1e-30))
    for light, guided in itertools.product((False, True), repeat=2):
        barred = barred_sets | (LIGHT & (not light)) | (GUIDED & (not guided))
        if barred.all() or (barred[start] and calm > 1):
            continue
        for price in PRICES:
            if adaptive:
                value = (numpy.sqrt(regions.error * regions.cost) +
                         price * share * regions.light_error)
            else:
                saved = regions.connection_cost * regions.area
                value = (regions.error + regions.light_error +
                         price * whole * (regions.cost + LIGHT[:, None] * saved))
            value[barred] = numpy.inf
            choice = value.argmin(axis=0)
            if calm > 1:
                stays = value[start] < calm * value.min(axis=0)
                choice = numpy.where(stays, start, choice)
            yield choice


def choose(regions, adaptive, calm=1.0, keeps_light=False):
    """The best set of the frame, and the best of each region."""
    count = len(regions.area)
    frames = [numpy.full(count, s) for s in range(len(SETS))]
    frame = min(frames, key=lambda choice: product(regions, choice, adaptive))
    barred = ~LIGHT & (keeps_light and LIGHT[frame[0]])
    mixed = min(itertools.chain([frame], assignments(regions, adaptive, frame[0], calm, barred)),
                key=lambda choice: product(regions, choice, adaptive))
    return frame, mixed


def beside(left, right):
    """The regions of a frame that shows two scenes side by side."""
    def joined(name):
        return numpy.concatenate([getattr(left, name), getattr(right, name)], axis=-1)
    return Regions(error=joined("error"), light_error=joined("light_error"), cost=joined("cost"),
                   area=joined("area") / 2, light_cost=left.light_cost + right.light_cost,
                   connection_cost=left.connection_cost + right.connection_cost,
                   training_cost=left.training_cost + right.training_cost)


def folds_of(counted, priced, outliers, edge):
    """For each half: its data to choose by, its data to evaluate by, and those of the others.
    counted, priced: what render_halves returns, by rays and by the cost to evaluate by."""
    halves, paths = priced
    counts = inliers(halves, outliers)
    return [(regions_of([counted[0][i]], counted[1], counts, edge),
             regions_of([half], paths, counts, edge),
             regions_of(halves[:i] + halves[i + 1:], paths, counts, edge))
            for i, half in enumerate(halves)]


def gains(folds, adaptive):
    """The gains, in the order of the columns; the frame's best sets, and the shares of the area
    that the choice `safe` gives the sets."""
    products = numpy.zeros((4, 2))
    hindsight = numpy.zeros((len(SETS), 2))  # [set, uniform or adaptive samples].
    best, shares = set(), numpy.zeros(len(SETS))
    for known, same, others in folds:
        for row, (data, judge, calm, keeps_light) in enumerate((
                (same, same, 1.0, False), (known, others, 1.0, False),
                (known, others, CALM, False), (known, others, 1.0, True))):
            frame, mixed = choose(data, adaptive, calm, keeps_light)
            products[row] += [product(judge, choice, adaptive) for choice in (frame, mixed)]
        best.add(SETS[frame[0]])
        for s in range(len(SETS)):
            whole = numpy.full(len(frame), s)
            hindsight[s] += [product(others, whole, adapts) for adapts in (False, True)]
            shares[s] += known.area[mixed == s].sum() / len(folds)
    uniform_best, adaptive_best = hindsight.min(axis=0)
    floor = (adaptive_best if adaptive else uniform_best) / products[-1, 1]
    ratios = [*(products[:, 0] / products[:, 1]), floor, uniform_best / adaptive_best]
    return ratios, sorted(best), shares


def print_rows(name, folds_by_edge):
    _, _, others = folds_by_edge[REGIONS_PX[0]][0]
    connections = others.connection_cost / (others.light_cost + others.connection_cost)
    for adaptive, edge in itertools.product((False, True), REGIONS_PX):
        values, best, shares = gains(folds_by_edge[edge], adaptive)
        print(f"| {name} | {100 * connections:.0f} % | {', '.join(best)} | {edge} | "
              f"{'adaptive' if adaptive else 'uniform'} | "
              f"{' | '.join(f'{value:.2f}' for value in values)} | "
              f"{', '.join(f'{share:.2f}' for share in shares)} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sheaf")
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="only these names")
    parser.add_argument("--width", type=int, default=128)
    parser.add_argument("--samples", type=int, default=128)
    parser.add_argument("--halves", type=int, default=2)
    parser.add_argument("--cost", choices=("rays", "cpu"), default="rays")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--outliers", type=float, default=0, metavar="FRACTION",
                        help="leave out this fraction of the pixels, of the largest variance")
    parser.add_argument("--pairs", action="store_true",
                        help="also frames that show two scenes side by side")
    parser.add_argument("--keep", help="keep images here, and use those that are there")
    options = parser.parse_args()
    scenes = {name: os.path.join(ROOT, "scenes", name + ".pbrt") for name in SCENES}
    public = os.environ.get("SHEAF_PUBLIC_SCENES", "")
    if public:
        scenes.update({name: os.path.join(public, path) for name, path in PUBLIC.items()})
    columns = ("scene", "connections", "frame", "region px", "samples", "best", "real", "calm",
               "safe", "floor", "adapting", f"area: {', '.join(SETS)}")
    print(f"| {' | '.join(columns)} |\n|{'---|' * len(columns)}")
    measured = {}
    for name, scene in scenes.items():
        if options.scenes and name not in options.scenes:
            continue
        with tempfile.TemporaryDirectory() as temporary:
            folder = options.keep or temporary
            os.makedirs(folder, exist_ok=True)
            counted, priced = (render_halves(options, name, scene, folder, cost)
                               for cost in ("rays", options.cost))
        measured[name] = {edge: folds_of(counted, priced, options.outliers, edge)
                          for edge in REGIONS_PX}
        print_rows(name, measured[name])
    for left, right in itertools.combinations(measured, 2) if options.pairs else ():
        print_rows(f"{left} beside {right}", {
            edge: [tuple(map(beside, *folds)) for folds in zip(measured[left][edge],
                                                               measured[right][edge])]
            for edge in REGIONS_PX})


if __name__ == "__main__":
    main()
