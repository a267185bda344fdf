# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Cases broken by hand: the case, a text of its scene, and a text in its place.

Each change is small, as a mistake would be, and each must be seen.
"""

CHANGES = (
    ("distant at 50 degrees", '"point3 to" [0 0 0]', '"point3 to" [0 0 -.03]'),
    ("point I", "[8 8 8]", "[7.8 7.8 7.8]"),
    ("point power and scale", '"float scale" 3', '"float scale" 1'),
    ("spot at 28 of 30 - 5 degrees", '"float conedeltaangle" 5', '"float conedeltaangle" 6'),
    ("projection fov", '"float fov" 20 "float scale" 8', '"float fov" 20 "float scale" 7.8'),
    ("infinite illuminance and scale", '"float illuminance" 5', '"float illuminance" 5.2'),
    ("area light power and scale", '"float scale" 3', '"float scale" 1'),
    ("area light power of a color", '"float power" 100', '"float power" 97'),
    ("camera fov 25", '"float fov" 25', '"float fov" 25.8'),
    ("camera from the right", "LookAt 3 1 -4", "LookAt 3.1 1 -4"),
    ("shutter open from 0 to .5", '"float shutterclose" 0.5', '"float shutterclose" 0.55'),
    ("filter gaussian of sigma .8, across", '"float sigma" .8', '"float sigma" .6'),
    ("filter mitchell of B 1 C 0, down", '"float C" 0', '"float C" .6'),
    ("texture udelta", '"float udelta" .3', '"float udelta" .32'),
    ("texture encoding gamma 1.4", "gamma 1.4", "gamma 1.5"),
    ("texture mix amount 0.25", '"float amount" 0.25', '"float amount" 0.29'),
    ("light of stdillum-F2", "stdillum-F2", "stdillum-F3"),
    ("black body of 4000 K", '"blackbody L" 4000', '"blackbody L" 3850'),
    ("metal-Cu at 550 nm", "metal-Cu-k", "metal-Au-k"),
    ("transform Rotate about a diagonal", "Rotate 70 1 2 3", "Rotate 73 1 2 3"),
    ("shape sphere of phimax 90", '"float phimax" 90', '"float phimax" 120'),
    ("furnace coateddiffuse of reflectance 0.9", '"float roughness" 0', '"float roughness" .5'),
    ("material anisotropic mesh tangents at 90 degrees, light across",
     "S\" [0.000000 1.000000 0 ", "S\" [1 0 0 "),
    ("medium single scattering of g 0.3, light beside", '"float g" 0.3', '"float g" 0.2'),
    ("medium homogeneous, scale", '"float scale" .5', '"float scale" .52'),
)
