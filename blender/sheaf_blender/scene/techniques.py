# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The techniques of the render panel: values of --techniques, with names and descriptions."""

PARTS = {
    "camera": ("Camera Paths", "Paths begin at the camera; lamps are sampled at each bounce"),
    "light": ("Light Paths", "paths also begin at lights: for caustics, and light that comes in "
                             "through gaps"),
    "merging": ("Merging", "light paths also end near points that the camera sees: for caustics in "
                           "mirrors and in glass"),
    "emission-guiding": ("Guided Emission", "light paths learn where they begin: where the image "
                                            "shows a small part of the scene"),
    "guiding": ("Guiding", "bounces learn where light comes from: for indirect light, as through a "
                           "door ajar"),
    "splitting": ("Splitting", "paths split where they bring much"),
    "learned-lights": ("Learned Lights", "places learn which lamps they see: where walls hide most "
                                         "of many lamps"),
    "product": ("Glossy Lights", "lamps are chosen by what the surface reflects: for many lamps "
                                 "over glossy surfaces"),
    "chains": ("Chains", "paths reach small lamps through smooth glass and mirrors: no fireflies "
                         "there, at several times the price"),
    "sharing": ("Sharing", "neighboring pixels share paths: less noise behind wide pixel filters"),
    "views": ("Shared Views", "points of the lens and of the shutter share paths: less noise in "
                              "what is blurred"),
    "mutations": ("Mutations", "bright paths are varied: their light spreads to other samples"),
}
_CHOICES = (
    "camera", "camera+light", "camera+light+merging", "camera+light+emission-guiding",
    "camera+light+merging+emission-guiding", "camera+sharing", "camera+sharing+views",
    "camera+mutations", "camera+chains", "camera+product", "camera+learned-lights",
    "camera+light+learned-lights", "camera+guiding", "camera+light+guiding",
    "camera+light+guiding+merging", "camera+guiding+splitting", "camera+light+guiding+splitting")


def _item(value):
    first, *others = value.split("+")
    names = ", ".join(PARTS[part][0] for part in (others or [first]))
    words = [PARTS[first][1], *(PARTS[part][1] for part in others)]
    return value, names, "; ".join(words)


ITEMS = (
    ("default", "Default", "Automatic for large frames, else Camera Paths"),
    ("auto", "Automatic", "A small image by each of four techniques is measured, and the one of "
                          "the least error for its time is used"),
    *map(_item, _CHOICES))
