#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Writes the table of Blender's settings in docs/blender.md from the add-on's own table.

Run: settings_document.py. meaning_test.py fails where the document is not that of the table.
"""
import os
import sys

sys.dont_write_bytecode = True
HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)

from sheaf_blender.scene import settings_table
from sheaf_blender.scene.settings_table import HANDLED, OWN, TABLE

PATH = os.path.join(os.path.dirname(HERE), "docs", "blender.md")
BEGIN, END = "<!-- settings: begin -->\n", "<!-- settings: end -->\n"
TITLES = {"ViewLayer": "View layer", "CyclesRenderLayerSettings": "View layer, Cycles",
          "LayerCollection": "Collection in a layer", "CyclesObjectSettings": "Object, Cycles",
          "PointLight": "Light", "CyclesLightSettings": "Light, Cycles",
          "CyclesWorldSettings": "World, Cycles", "CyclesVisibilitySettings":
          "World, Ray Visibility", "CyclesRenderSettings": "Scene, Cycles",
          "CyclesCurveRenderSettings": "Hair, Cycles", "CyclesCameraSettings": "Camera, Cycles",
          "CameraDOFSettings": "Depth of field", "CameraStereoData": "Stereoscopy",
          "RenderSettings": "Render", "ImageUser": "Image in a node",
          "ColorManagedInputColorspaceSettings": "Color space of an image",
          "CyclesMaterialSettings": "Material, Cycles", "VolumeRender": "Volume, render"}
REPEATED = ("SpotLight", "SunLight", "AreaLight")


def document():
    """The lines between the marks."""
    lines = ["| of | property | Sheaf |", "|---|---|---|"]
    for owner, settings in TABLE.items():
        if owner in REPEATED:
            continue
        for setting in settings:
            names = ", ".join(f"`{name}`" for name in setting.names.split())
            words = {HANDLED: "as in Cycles", OWN: "Sheaf's own"}.get(setting.treatment, "reported")
            text = f"{words}: {setting.text}" if setting.text else words
            lines.append(f"| {TITLES.get(owner, owner)} | {names} | {text} |")
    return "\n".join(lines) + "\n"


def with_table(text):
    """The document with the present table."""
    before, rest = text.split(BEGIN)
    return before + BEGIN + document() + END + rest.split(END)[1]


def main():
    with open(PATH, encoding="utf-8") as file:
        text = file.read()
    with open(PATH, "w", encoding="utf-8") as file:
        file.write(with_table(text))


if __name__ == "__main__":
    assert set(REPEATED) <= set(settings_table.TABLE)
    main()
