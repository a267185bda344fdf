# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The small scenes that the cases are made of, and the list of all cases."""
import math
import os
import tempfile

import numpy as np
import OpenImageIO as oiio

CASES = []
# Where images and meshes of the scenes lie; scenes name them without a folder.
FOLDER = tempfile.mkdtemp(prefix="sheaf features ")
SIZE = 8


class Case:
    """A scene, and what its image must be: the mean of R, G, B, or an array of pixels."""

    def __init__(self, name, text, want, layer="RGB", pixels=None):
        self.name, self.scene, self.layer, self.pixels = name, text, layer, pixels
        self.color = "spectral" if text.startswith("# spectral\n") else "rgb"
        self.want = np.array(want, dtype=float)


def case(name, scene, want, **more):
    """pixels: a part of the image, as slices of rows and columns."""
    CASES.append(Case(name, scene, want, **more))


def gray(value):
    return (value,) * 3


def rgb(values):
    return f'[{" ".join(repr(float(v)) for v in values)}]'


def window(half):
    return f'Camera "orthographic" "float screenwindow" [{-half} {half} {-half} {half}]\n'


LOOK = "LookAt 0 0 -5  0 0 0  0 1 0\n"


def film(width=SIZE, height=SIZE, more=""):
    return (f'Film "rgb" "integer xresolution" {width} "integer yresolution" {height} {more}\n')


# x is to the right and y up in the image; the camera looks along z.
def scene(world, camera=LOOK + window(1), films=film(), samples=16, before="", pixel_filter="box",
          integrator='Integrator "volpath" "integer maxdepth" 1\n', color="rgb"):
    return (f'# {color}\n{before}{camera}{films}PixelFilter "{pixel_filter}"\n'
            f'Sampler "zsobol" "integer pixelsamples" {samples}\n{integrator}'
            f'WorldBegin\n{world}\n')


def rectangle(x0=-1, x1=1, y0=-1, y1=1, z=0, more=""):
    """Faces the camera, with u along x and v along y."""
    return (f'Shape "trianglemesh" "point3 P" [{x0} {y0} {z} {x0} {y1} {z} {x1} {y1} {z} {x1} {y0} '
            f'{z}] "point2 uv" [0 0 0 1 1 1 1 0] "integer indices" [0 1 2 0 2 3] {more}\n')


def lamp(shape, light='"rgb L" [1 1 1]'):
    return f'AttributeBegin\nAreaLightSource "diffuse" {light}\n{shape}\nAttributeEnd\n'


def polygon(points):
    """A lamp of radiance 1 on both sides."""
    numbers = " ".join(f"{c:.9g}" for p in points for c in p)
    faces = " ".join(f"0 {i} {i + 1}" for i in range(1, len(points) - 1))
    return lamp(f'Shape "trianglemesh" "point3 P" [{numbers}] "integer indices" [{faces}]',
                '"rgb L" [1 1 1] "bool twosided" true')


GRAY = 'Material "diffuse" "spectrum reflectance" [300 .5 900 .5]\n'
BLACK = 'Material "diffuse" "spectrum reflectance" [300 0 900 0]\n'
# On a plate that faces it, a texture's value is what the camera sees.
SUN = ('LightSource "distant" "point3 from" [0 0 -1] "point3 to" [0 0 0] "rgb L" [1 1 1] '
       f'"float scale" {math.pi}\n')


def plate(light, material=GRAY, half=0.01, **more):
    """The middle of a large plate at z = 0 under a light; the plate reflects a half."""
    more.setdefault("camera", LOOK + window(half))
    return scene(f"{light}\n{material}{rectangle(-99, 99, -99, 99)}", **more)


def image(name, texels, depth="float"):
    """Writes texels[row][column](channel); a file of 8 or 16 bits gets them as they are."""
    assert not os.path.exists(os.path.join(FOLDER, name)), name
    texels = np.array(texels, dtype=np.float32)
    if texels.ndim == 2:
        texels = texels[:, :, None]
    height, width, channels = texels.shape
    out = oiio.ImageOutput.create(os.path.join(FOLDER, name))
    spec = oiio.ImageSpec(width, height, channels, depth)
    spec.attribute("oiio:ColorSpace", "Linear" if depth == "float" else "sRGB")
    out.open(os.path.join(FOLDER, name), spec)
    out.write_image(np.ascontiguousarray(texels))
    out.close()
    return name


def write(name, text):
    with open(os.path.join(FOLDER, name), "w", encoding="utf-8") as file:
        file.write(text)
    return name


def srgb_to_linear(v):
    v = np.asarray(v, dtype=float)
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)
