# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Compares the passes of one render with geometry, and with those of Cycles."""
import numpy
import OpenImageIO

LAYER = "ViewLayer"
# For the scene `layers` (scenes_more.py).
HEIGHT, MIST, SPEED = 5.0, (2.0, 6.0), 0.5
BALLS = {"Left ball": (-1.0, 0.0), "Right ball": (1.0, 0.0)}
SCALE = 24.0  # Pixels per unit on the plane: the film shows 4 units in 96 pixels.


def read(path):
    """({channel without the view layer: pixels}, attributes)."""
    file = OpenImageIO.ImageInput.open(str(path))
    if file is None:
        raise OSError(f"{path}: {OpenImageIO.geterror()}")
    channels, attributes = {}, {}
    part = 0
    while file.seek_subimage(part, 0):
        spec = file.spec()
        pixels = file.read_image("float").reshape(spec.height, spec.width, spec.nchannels)
        channels.update({name.removeprefix(LAYER + "."): pixels[:, :, i]
                         for i, name in enumerate(spec.channelnames)})
        attributes.update({a.name: a.value for a in spec.extra_attribs})
        part += 1
    file.close()
    return channels, attributes


def stack(channels, layer, letters):
    found = {name.lower(): pixels for name, pixels in channels.items()}
    return numpy.stack([found[f"{layer}.{letter}".lower()] for letter in letters], axis=-1)


def spot(x, y):
    """The pixel that shows a point of the plane."""
    return int(round(32 - SCALE * y - 0.5)), int(round(48 + SCALE * x - 0.5))


def check_geometry(channels, check):
    """The plane at z = 0, seen from straight above."""
    place = spot(0.0, 1.0)
    found = {layer: stack(channels, layer, letters)[place] for layer, letters in (
        ("Depth", "Z"), ("Normal", "XYZ"), ("Position", "XYZ"), ("Mist", "Z"), ("UV", "UVA"),
        ("Denoising Albedo", "RGB"), ("Denoising Normal", "XYZ"))}
    x, y = (place[1] + 0.5 - 48) / SCALE, (32 - place[0] - 0.5) / SCALE
    along = (HEIGHT**2 + x**2 + y**2) ** 0.5
    for layer, expected in (
            ("Depth", [HEIGHT]), ("Normal", [0, 0, 1]), ("Position", [x, y, 0]),
            ("Mist", [((along - MIST[0]) / MIST[1]) ** 2]), ("UV", [x / 20 + 0.5, y / 20 + 0.5, 1]),
            ("Denoising Albedo", [0.5] * 3), ("Denoising Normal", [0, 0, 1])):
        check(numpy.allclose(found[layer], expected, atol=0.01),
              f"{layer} of a plane is {numpy.round(found[layer], 3)}")
    x, y = BALLS["Right ball"]
    vector = stack(channels, "Vector", "XYZW")[spot(x, y)]
    pixels = SPEED * SCALE * HEIGHT / (HEIGHT - 0.4)  # In a frame; the ball's top is nearer.
    check(numpy.allclose(vector, [-pixels, 0, -pixels, 0], atol=0.5),
          f"Vector of a ball that moves {pixels:.1f} pixels to the right is "
          f"{numpy.round(vector, 1)}")


def check_light(channels, check):
    kinds = [name for name in channels if name.startswith("Sheaf ") and name.endswith(".R")]
    total = sum(channels[name] for name in kinds)
    check(len(kinds) == 9 and numpy.allclose(total, channels["Combined.R"], rtol=1e-3, atol=1e-4),
          f"{len(kinds)} kinds of light add up to the image")


def check_mattes(channels, attributes, picked, check):
    composite = next(pixels for name, pixels in channels.items()
                     if name.endswith("Composite.Combined.R") or name == "Composite.Combined.R")
    inside = [composite[spot(*place)] for name, place in BALLS.items() if name == picked]
    outside = [composite[spot(*place)] for name, place in BALLS.items() if name != picked]
    outside.append(composite[spot(0.0, 1.0)])
    check(min(inside) > 0.99 and max(outside) < 0.01,
          f'the Cryptomatte node picks "{picked}" alone: {inside}, {outside}')
    manifests = [value for name, value in attributes.items()
                 if name.startswith("cryptomatte/") and name.endswith("/manifest")]
    check(any(picked in manifest for manifest in manifests),
          "the file that Blender saves has the names of the mattes")


def check_like_cycles(sheaf, cycles, check):
    """Where neither has an edge, the passes agree."""
    for layer, letters, tolerance in (
            ("Depth", "Z", 0.01), ("Normal", "XYZ", 0.03), ("Position", "XYZ", 0.02),
            ("Mist", "Z", 0.01), ("Denoising Albedo", "RGB", 0.02), ("Vector", "XYZW", 0.6)):
        ours, theirs = stack(sheaf, layer, letters), stack(cycles, layer, letters)
        flat = numpy.ones(ours.shape[:2], bool)
        for pixels in (ours, theirs):
            for axis in (0, 1):
                step = numpy.abs(numpy.diff(pixels, axis=axis)).max(axis=-1) > 10 * tolerance
                flat &= ~numpy.pad(step, [(int(axis == 0), 0), (int(axis == 1), 0)])
                flat &= ~numpy.pad(step, [(0, int(axis == 0)), (0, int(axis == 1))])
        away = numpy.abs(ours - theirs).max(axis=-1)[flat]
        check(flat.mean() > 0.5 and numpy.quantile(away, 0.95) < tolerance,
              f"{layer} is Cycles', within {numpy.quantile(away, 0.95):.4f} in {flat.mean():.0%}")
