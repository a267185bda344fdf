#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Writes docs/techniques.md: what paths from lights find and cost, scene by scene, with pictures.

    tests/bench/techniques_page.py SHEAF [SCENE ...] [--samples 64] [--out docs/techniques.md]

SHEAF is a build's program `sheaf`. Renders each scene by camera paths alone and by camera and light
paths, with the same number of samples, against a reference of many more, and puts beside it what
`--techniques auto` measures on its small image. CPU seconds include everything that a worker does
for a sample. Scenes of SHEAF_PUBLIC_SCENES are added if it is set.
"""
import argparse
import json
import os
import subprocess
import sys
import tempfile

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
# Name and scene.
SCENES = [
    ("caustic", "scenes/caustic.pbrt"),
    ("pool", "scenes/pool.pbrt"),
    ("frosted", "scenes/frosted.pbrt"),
    ("ajar", "scenes/ajar.pbrt"),
    ("showroom", "scenes/showroom.pbrt"),
    ("cornell-box", "scenes/cornell-box.pbrt"),
    ("fog-room", "scenes/fog-room.pbrt"),
]
PUBLIC = [
    ("cornell-box-specular", "cornell-box/cornell-box-specular-small.pbrt"),
    ("killeroo-simple", "killeroos/killeroo-simple-small.pbrt"),
    ("veach-mis", "veach-mis/veach-mis-small.pbrt"),
]
REFERENCE_FACTOR = 8
PICTURES = ("caustic", "pool", "frosted")
TECHNIQUES = ("camera", "camera+light")


def run(command):
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)}: {done.stderr}")
    return done.stdout


def render(sheaf, scene, techniques, samples, seed, out, png=None):
    """Renders, and returns the CPU seconds of the frame."""
    command = [sheaf, "render", scene, "--techniques", techniques, "--samples", str(samples),
               "--seed", str(seed), "--json", "-o", out]
    summary = run(command + (["--png", png] if png else []))
    return json.loads(summary.strip().splitlines()[-1])


def cpu_seconds(summary):
    return summary["progress"]["cpu_duration_seconds"]


def measure(sheaf, name, scene, samples, folder, pictures):
    reference = os.path.join(folder, "reference.exr")
    render(sheaf, scene, "camera+light", samples * REFERENCE_FACTOR, 2, reference)
    row = {"name": name}
    for techniques in TECHNIQUES:
        out = os.path.join(folder, techniques + ".exr")
        png = None
        if name in PICTURES:
            png = os.path.join(pictures, f"{name}-{techniques.replace('+', '-and-')}.png")
        summary = render(sheaf, scene, techniques, samples, 1, out, png)
        compared = json.loads(run([sheaf, "compare", out, reference, "--json"]))
        row[techniques] = {"cpu_seconds": cpu_seconds(summary), "rel_mse": compared["relative_mse"]}
    plan = json.loads(run([sheaf, "plan", scene, "--measure", "--measure-seconds", "0.5",
                           "--json"]))
    row["measured"] = plan["measurement"]["techniques"]
    return row


def number(value):
    return f"{value:.3g}"


def gain(row):
    camera, both = row["camera"], row["camera+light"]
    return (camera["rel_mse"] * camera["cpu_seconds"]) / (both["rel_mse"] * both["cpu_seconds"])


def page(rows, samples, public):
    lines = [
        "# What each technique finds, and what it costs", "",
        "`tests/bench/techniques_page.py` writes this page. Each scene is rendered with "
        f"{samples} samples a pixel by paths from the camera alone, and with {samples} samples "
        f"and {samples} passes of light paths; relMSE is against an image of "
        f"{samples * REFERENCE_FACTOR} samples and passes. *Gain* is relMSE times CPU seconds, "
        "camera over both: above 1, light paths pay. *auto* is what `--techniques auto` chooses "
        "from its small image, with the gain that it measures there in rays.", "",
        "| scene | light that light paths find | relMSE, camera | relMSE, both | CPU s, camera "
        "| CPU s, both | gain | auto |", "|---|---|---|---|---|---|---|---|"]
    for row in rows:
        measured = row["measured"]
        by_rays = measured["gain"]
        of_auto = "camera paths miss light" if by_rays is None else number(by_rays)
        auto = f"{measured['best']} ({of_auto})"
        lines.append(
            f"| {row['name']} | {100 * measured['light_share']:.2g} % "
            f"| {number(row['camera']['rel_mse'])} | {number(row['camera+light']['rel_mse'])} "
            f"| {number(row['camera']['cpu_seconds'])} "
            f"| {number(row['camera+light']['cpu_seconds'])} | {number(gain(row))} | {auto} |")
    if not public:
        lines += ["", "The public scenes were not there and are left out."]
    for name in PICTURES:
        if any(row["name"] == name for row in rows):
            lines += ["", f"## {name}", "",
                      "Camera paths alone, and both, with the same number of samples:", "",
                      f"![camera](techniques/{name}-camera.png) "
                      f"![both](techniques/{name}-camera-and-light.png)"]
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sheaf")
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="only these names")
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--out", default=os.path.join(ROOT, "docs", "techniques.md"))
    options = parser.parse_args()
    public = os.environ.get("SHEAF_PUBLIC_SCENES", "")
    scenes = [(name, os.path.join(ROOT, path)) for name, path in SCENES]
    if public:
        scenes += [(name, os.path.join(public, path)) for name, path in PUBLIC]
    pictures = os.path.join(os.path.dirname(os.path.abspath(options.out)), "techniques")
    os.makedirs(pictures, exist_ok=True)
    rows = []
    for name, scene in scenes:
        if options.scenes and name not in options.scenes:
            continue
        with tempfile.TemporaryDirectory() as folder:
            rows.append(measure(options.sheaf, name, scene, options.samples, folder, pictures))
        print(json.dumps(rows[-1]), flush=True)
    with open(options.out, "w", encoding="utf-8") as file:
        file.write(page(rows, options.samples, bool(public)))


if __name__ == "__main__":
    main()
