# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Compares an image of Sheaf with that of Cycles, and writes both and their difference as a PNG."""
import numpy
import OpenImageIO

BLOCK_PX = 8
BLOCK_DIFFERENCE_MAX = 0.06  # Fraction of the block, plus
IMAGE_DIFFERENCE_MAX = 0.03  # that of the image.
CHANNEL_MIN = 0.01  # The least mean that a channel is compared to, as a part of that of all three.


def read(path):
    file = OpenImageIO.ImageInput.open(str(path))
    if file is None:
        raise OSError(f"{path}: {OpenImageIO.geterror()}")
    spec = file.spec()
    pixels = file.read_image("float").reshape(spec.height, spec.width, spec.nchannels)
    file.close()
    return pixels[:, :, :3]


def read_all(path):
    """{channel: (height, width)} of a file of layers."""
    file = OpenImageIO.ImageInput.open(str(path))
    if file is None:
        raise OSError(f"{path}: {OpenImageIO.geterror()}")
    spec = file.spec()
    pixels = file.read_image(0, 0, 0, spec.nchannels, "float")
    file.close()
    pixels = pixels.reshape(spec.height, spec.width, spec.nchannels)
    return {name: pixels[:, :, i] for i, name in enumerate(spec.channelnames)}


def compare(folder, scene):
    """Relative differences of the means of R, G and B, and SCENE.png: Cycles, Sheaf, difference."""
    cycles, sheaf = (read(folder / f"{scene}.{engine}.exr") for engine in ("cycles", "sheaf"))
    if cycles.shape != sheaf.shape:
        raise ValueError(f"{scene}: sizes {cycles.shape} and {sheaf.shape} differ")
    means = cycles.mean(axis=(0, 1)), sheaf.mean(axis=(0, 1))
    gray = numpy.clip(0.5 + (sheaf - cycles) / (2 * means[0].mean()), 0, 1)
    shown = numpy.concatenate([curve(cycles), curve(sheaf), gray], axis=1)
    shown = numpy.repeat(numpy.repeat(shown, 4, axis=0), 4, axis=1)
    spec = OpenImageIO.ImageSpec(shown.shape[1], shown.shape[0], 3, "uint8")
    output = OpenImageIO.ImageOutput.create("x.png")
    output.open(str(folder / f"{scene}.png"), spec)
    output.write_image(numpy.ascontiguousarray(shown, numpy.float32))
    output.close()
    least = CHANNEL_MIN * float(means[0].mean()) or 1.0  # A channel may be black.
    return ((means[1] - means[0]) / numpy.maximum(means[0], least)).tolist()


def mean_and_error(path):
    """(mean of R, G and B, its standard error) by the layer of standard errors of Sheaf's image."""
    channels = read_all(path)
    errors = numpy.stack([channels[f"stderr.{name}"] for name in "RGB"]).astype(float)
    mean = numpy.mean([channels[name] for name in "RGB"], dtype=float)
    # The channels of a pixel share their paths.
    return float(mean), float((errors.mean(axis=0) ** 2).sum() ** 0.5 / errors[0].size)


def alpha_difference(folder, scene):
    """The mean of the differences of alpha; 0 where an image has none."""
    first, second = (read_all(folder / f"{scene}.{engine}.exr").get("A")
                     for engine in ("cycles", "sheaf"))
    return 0.0 if first is None or second is None else float(abs(first - second).mean())


def blocks_apart(folder, scene):
    """(count of blocks that differ, blocks, the largest difference as a fraction of the image)."""
    cycles, sheaf = (read(folder / f"{scene}.{engine}.exr")
                     for engine in ("cycles", "sheaf"))
    mean, apart, blocks, largest = float(cycles.mean()), 0, 0, 0.0
    for y in range(0, cycles.shape[0] - BLOCK_PX + 1, BLOCK_PX):
        for x in range(0, cycles.shape[1] - BLOCK_PX + 1, BLOCK_PX):
            first, second = (float(image[y:y + BLOCK_PX, x:x + BLOCK_PX].mean())
                             for image in (cycles, sheaf))
            blocks += 1
            difference = abs(second - first)
            largest = max(largest, difference / (mean or 1.0))
            apart += difference > BLOCK_DIFFERENCE_MAX * abs(first) + IMAGE_DIFFERENCE_MAX * mean
    return apart, blocks, largest


def curve(light):
    light = numpy.clip(light, 0, 1)
    return numpy.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def same_pixels(first, second):
    return numpy.array_equal(read(first), read(second))
