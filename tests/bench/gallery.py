#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Writes docs/gallery.md: scenes with their image, time and error.

    tests/bench/gallery.py SHEAF [--public FOLDER] [--samples 32] [--width 280] [--scene NAME ...]

SHEAF is a build's program `sheaf`. Renders the scenes of scenes/, and the .pbrt files of FOLDER and
its folders that have a Film, by one process each. Times and errors are those that `sheaf render
--json` reports. Images are made smaller to WIDTH pixels by Debian's python3-openimageio; error and
time are those of the whole image. A scene that cannot be rendered gets a row that says why.
"""
import argparse
import json
import os
import re
import shlex
import subprocess
import sys
import tempfile

import OpenImageIO as oiio

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
SECONDS_MAX = 3600  # For one scene.
IMAGES_BYTES_MAX = 1536 << 10  # For all images together.
# A .pbrt file without a film is included by another.
FILM = re.compile(r"^\s*Film\b", re.M)


def scenes_of(folder):
    """The scene files below a folder, by path."""
    found = []
    for parent, _, names in os.walk(folder):
        for name in names:
            path = os.path.join(parent, name)
            if name.endswith(".pbrt"):
                with open(path, encoding="utf-8", errors="replace") as file:
                    if FILM.search(file.read()):
                        found.append(path)
    return sorted(found)


def shrink(source, target, width_px):
    """Writes a PNG as another one of at most this width."""
    image = oiio.ImageBuf(source)
    spec = image.spec()
    if spec.width > width_px:
        height_px = max(1, round(spec.height * width_px / spec.width))
        target_px = oiio.ROI(0, width_px, 0, height_px, 0, 1, 0, 3)
        image = oiio.ImageBufAlgo.resize(image, roi=target_px)
    if not image.write(target):
        sys.exit(f"{target}: {image.geterror()}")


def render(options, scene, name, target):
    """Renders, and returns the row of the page."""
    row = {"name": name, "image": None, "problem": ""}
    with tempfile.TemporaryDirectory() as folder:
        png = os.path.join(folder, "image.png")
        done = subprocess.run([options.sheaf, "render", scene, "--samples", str(options.samples),
                               "--json", "-o", png],
                              capture_output=True, text=True, timeout=SECONDS_MAX)
        if done.returncode:
            said = [json.loads(line) for line in done.stderr.splitlines() if line.startswith("{")]
            errors = [line["message"] for line in said if line["severity"] == "error"]
            words = errors[-1].split("\n")[0] if errors else f"exit code {done.returncode}"
            row["problem"] = words.replace(os.path.dirname(scene) + "/", "")
            return row
        frame = json.loads(done.stdout.splitlines()[-1])["frames"][0]
        shrink(png, target, options.width)
    progress = frame["progress"]
    row.update(image=target, width=frame["width_px"], height=frame["height_px"],
               samples=frame["sample_count"], flip=frame["flip"],
               cpu_seconds=progress["cpu_duration_seconds"], relative_mse=progress["relative_mse"],
               wall_seconds=progress["wall_duration_seconds"])
    return row


def number(value):
    return "-" if value is None else f"{value:.2g}"


def page(rows, arguments, folder):
    command = "tests/bench/gallery.py SHEAF" + "".join(" " + shlex.quote(a) for a in arguments)
    lines = ["# Gallery", "",
             "Scenes that Sheaf renders, and what they cost. The images have few samples,",
             "which shows where noise is. [scenes/README.md](../scenes/README.md) says what",
             "each scene is for.",
             "",
             "Time and error are those of the whole image; the images of this page are",
             "smaller. The time is the CPU time of rendering, without the reading of the",
             "scene. relMSE is the mean of the squared relative error of the pixels, as the",
             "image's own error bars estimate it: 0.01 is an error of 10 % for a typical",
             "pixel. FLIP is the visible difference, from 0 to 1 ([accuracy](accuracy.md)).",
             "Values of relMSE above 1 come from a few pixels that are far too bright;",
             "[techniques](techniques.md) has other ways to render such scenes.",
             "",
             f"Made by `{command}`.", "",
             "| scene | image | pixels | samples a pixel | CPU time | relMSE | FLIP |",
             "|---|---|---|---|---|---|---|"]
    for row in rows:
        if row["image"] is None:
            words = row["problem"].replace("|", "\\|")
            lines.append(f"| {row['name']} | not rendered: {words} | | | | | |")
            continue
        path = os.path.relpath(row["image"], folder)
        name = row["name"]
        lines.append(f"| {name} | ![{name}]({path}) | {row['width']} x {row['height']} "
                     f"| {row['samples']} | {row['cpu_seconds']:.1f} s "
                     f"| {number(row['relative_mse'])} | {number(row['flip'])} |")
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("sheaf", help="the program sheaf")
    parser.add_argument("--public", help="folder of further scenes")
    parser.add_argument("--samples", type=int, default=32, help="a pixel (default 32)")
    parser.add_argument("--width", type=int, default=280, help="of images, pixels (default 280)")
    parser.add_argument("--scene", action="append", default=[], help="only these, by name")
    parser.add_argument("--out", default=os.path.join(ROOT, "docs"), help="folder of the page")
    options = parser.parse_args()
    scenes = sorted(p for p in scenes_of(os.path.join(ROOT, "scenes"))
                    if "turntable" not in p or p.endswith("turntable.0001.pbrt"))
    scenes += scenes_of(options.public) if options.public else []
    pictures = os.path.join(options.out, "gallery")
    os.makedirs(pictures, exist_ok=True)
    rows = []
    # The page names what was asked for, but no folder of this machine.
    arguments = ["FOLDER" if a == options.public else a for a in sys.argv[2:]]
    names = set()
    for scene in scenes:
        name = os.path.splitext(os.path.basename(scene))[0]
        if options.scene and name not in options.scene:
            continue
        if name in names:  # A scene of another folder has it.
            name += " of " + os.path.basename(os.path.dirname(scene))
        names.add(name)
        picture = os.path.join(pictures, name.replace(" ", "-") + ".png")
        rows.append(render(options, scene, name, picture))
        print(name, rows[-1].get("cpu_seconds", rows[-1]["problem"]), flush=True)
        with open(os.path.join(options.out, "gallery.md"), "w", encoding="utf-8") as file:
            file.write(page(rows, arguments, options.out))  # So that an interruption loses little.
    size = sum(os.path.getsize(row["image"]) for row in rows if row["image"])
    if size > IMAGES_BYTES_MAX:
        print(f"the images have {size >> 10} KiB together, more than {IMAGES_BYTES_MAX >> 10}: do "
              "not commit them; choose a smaller --width", file=sys.stderr)


if __name__ == "__main__":
    main()
