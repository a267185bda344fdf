#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Writes docs/techniques.md: what each technique finds and costs, scene by scene, with pictures.

    tests/bench/techniques_page.py SHEAF [SCENE ...] [--samples 64] [--out docs/techniques.md]

SHEAF is a build's program `sheaf`. Renders each scene by each choice of techniques with the same
number of samples, compares with a reference of many more, and puts beside it what `--techniques
auto` measures on its small image. CPU seconds are those of the process: they include the training
of guided frames and the loading of the scene. Scenes of SHEAF_PUBLIC_SCENES are added if it is set.
Rows are kept in docs/techniques/rows.json, so that those of scenes that are not named stay.
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
# All techniques together have the least noise in each of the scenes, so that a reference by them
# hides the least of what the others differ in. Tests show that all have the same expectation.
REFERENCE_TECHNIQUES = "camera+light+guiding"
REFERENCE_FACTOR = 16
# Scenes for one technique each: it is compared with the ones that find the same light otherwise.
# The first is the baseline, the last makes the reference.
SPECIAL = {
    "pool-from-above": ("camera", "camera+light", "camera+light+merging"),
    "shop-window": ("camera", "camera+light", "camera+light+merging", "camera+chains"),
    "lamps": ("camera", "camera+learned-lights", "camera+product"),
}
# The floor alone: a pixel that sees a lamp, of a hundredth of its size, has an error that hides all
# others.
OPTIONS = {"lamps": ("--crop", "0,90,320,200")}
# Each with the techniques of its second picture; the first is by camera paths.
PICTURES = {
    "caustic": REFERENCE_TECHNIQUES,
    "ajar": REFERENCE_TECHNIQUES,
    "frosted": REFERENCE_TECHNIQUES,
    "pool-from-above": "camera+light+merging",
    "shop-window": "camera+chains",
    "lamps": "camera+product",
}
TECHNIQUES = ("camera", "camera+light", "camera+guiding", "camera+light+guiding",
              "camera+guiding+splitting", "camera+light+guiding+splitting",
              "camera+light+emission-guiding")


def run(command):
    """Returns the standard output, and notes the CPU seconds of the processes."""
    before = os.times()
    done = subprocess.run(command, capture_output=True, text=True)
    after = os.times()
    run.cpu_seconds = (after.children_user + after.children_system -
                       before.children_user - before.children_system)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)}: {done.stderr}")
    return done.stdout


def render(sheaf, scene, techniques, samples, seed, out, png=None, options=()):
    """Renders, and returns the CPU seconds of the process."""
    command = [sheaf, "render", scene, "--techniques", techniques, "--samples", str(samples),
               "--seed", str(seed), "--json", "-o", out, *options]
    run(command + (["--png", png] if png else []))
    return run.cpu_seconds


def techniques_of(name):
    return SPECIAL.get(name, TECHNIQUES)


def picture_of(name, techniques):
    return f"{name}-{techniques.replace('+', '-')}.png"


def measure(sheaf, name, scene, samples, folder, pictures):
    reference = os.path.join(folder, "reference.exr")
    by = SPECIAL[name][-1] if name in SPECIAL else REFERENCE_TECHNIQUES
    options = OPTIONS.get(name, ())
    render(sheaf, scene, by, samples * REFERENCE_FACTOR, 2, reference, options=options)
    row = {"name": name, "samples": samples, "results": {}}
    for techniques in techniques_of(name):
        out = os.path.join(folder, techniques + ".exr")
        png = None
        if techniques in ("camera", PICTURES.get(name)) and name in PICTURES:
            png = os.path.join(pictures, picture_of(name, techniques))
        cpu_seconds = render(sheaf, scene, techniques, samples, 1, out, png, options)
        compared = json.loads(run([sheaf, "compare", reference, out, "--json"]))
        row["results"][techniques] = {"cpu_seconds": cpu_seconds,
                                      "rel_mse": compared["relative_mse"]}
    plan = json.loads(run([sheaf, "plan", scene, "--measure", "--measure-seconds", "0.5",
                           "--json", *options]))
    measured = plan["measurement"]["techniques"]
    row["light_share"] = measured["light_share"]
    row["best"] = measured["best"]
    return row


def number(value):
    return f"{value:.3g}"


def efficiency(row, techniques):
    """How many times as efficient as camera paths: error times CPU seconds."""
    def cost(name):
        return row["results"][name]["cpu_seconds"] * row["results"][name]["rel_mse"]
    return cost("camera") / cost(techniques)


def page(rows):
    special = [row["name"] for row in rows if row["name"] in SPECIAL]
    lines = [
        "# Techniques, scene by scene", "",
        "A renderer can look for light in several ways: from the camera, from the lights, or "
        "along directions that it has learned. Each is good at some scenes and bad at others, "
        "and all give the same image in the end. "
        "You need not choose: `--techniques auto` measures them, and the last column says what "
        "it chooses.", "",
        "A high efficiency is good: 2 means the same error in half the time of paths from the "
        "camera (`camera`, which is 1). The relMSE is the mean of the squared relative error of "
        "the pixels: 0.01 is an error of 10 % for a typical pixel. Values above 1 mean that a "
        "few pixels are far too bright, because a way finds some light so seldom: the image is "
        "useless, and another way is needed.", "",
        "Made by `tests/bench/techniques_page.py`. Each image has "
        f"{rows[0]['samples']} samples a pixel; relMSE is against a reference of "
        f"{rows[0]['samples'] * REFERENCE_FACTOR} by all techniques (in "
        f"{', '.join(special)} by the last rows), which has noise of its own. "
        "Images of lamps show its floor alone. "
        "CPU seconds are those of the whole process, with loading and training. Efficiency is "
        "error times CPU seconds, relative to camera paths. The last column says what "
        "`--techniques auto` chooses from its small image, for the samples that the scene asks "
        "for. Light paths begin at every kind of light, and in media that emit.", "",
        "Techniques are those of a whole frame. A choice by region gains a tenth at most in each "
        "scene where `tests/bench/technique_regions.py` measured it: "
        "[ADR 97](adr/0097-techniques-by-frame.md). The gain of `auto`, with the price of its own "
        "choice, is in [ADR 64](adr/0064-techniques-by-measured-efficiency.md). Where the picture "
        "shows a small part of the scene, `+emission-guiding` learns where light paths begin that "
        "reach it: [ADR 128](adr/0128-emission-is-guided.md). Where most of many lights are behind "
        "walls, `+learned-lights` learns which ones each region sees: "
        "[ADR 190](adr/0190-lights-are-learned-alone.md). Where many lights are over glossy "
        "surfaces, `+product` samples those that a point reflects to the camera: "
        "[ADR 240](adr/0240-lights-by-product.md). `+mutations` spreads samples that are far too "
        "bright; it gained in no scene against the best of the others, and is closed by the kill "
        "rule: [mutations](mutations.md). `+chains` connects paths to small lamps through smooth "
        "glass and mirrors, without bias: it removes fireflies where a lamp shines through glass "
        "that the camera looks through, for 4 to 8 times the CPU seconds: "
        "[ADR 210](adr/0210-chains.md). `auto` measures all of these but `+mutations`.", "",
        "| scene | techniques | relMSE | CPU s | efficiency | light that light paths find | auto |",
        "|---|---|---|---|---|---|---|"]
    for row in rows:
        for techniques, result in row["results"].items():
            is_first = techniques == "camera"
            share = f"{100 * row['light_share']:.2g} %" if is_first else ""
            lines.append(
                f"| {row['name'] if is_first else ''} | {techniques} "
                f"| {number(result['rel_mse'])} | {number(result['cpu_seconds'])} "
                f"| {number(efficiency(row, techniques))} | {share} "
                f"| {row['best'] if is_first else ''} |")
    for name, second in PICTURES.items():
        if any(row["name"] == name for row in rows):
            lines += ["", f"## {name}", "",
                      f"By camera paths alone, and by {second}, with the same number of samples:",
                      "",
                      f"![camera](techniques/{picture_of(name, 'camera')}) "
                      f"![{second}](techniques/{picture_of(name, second)})"]
    return "\n".join(lines) + "\n"


def kept_rows(path):
    if not os.path.exists(path):
        return {}
    with open(path, encoding="utf-8") as file:
        return {row["name"]: row for row in json.load(file)}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sheaf")
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="only these names")
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--out", default=os.path.join(ROOT, "docs", "techniques.md"))
    options = parser.parse_args()
    public = os.environ.get("SHEAF_PUBLIC_SCENES", "")
    scenes = [(name, os.path.join(ROOT, path)) for name, path in SCENES]
    scenes += [(name, os.path.join(ROOT, "scenes", name + ".pbrt")) for name in SPECIAL]
    if public:
        scenes += [(name, os.path.join(public, path)) for name, path in PUBLIC]
    pictures = os.path.join(os.path.dirname(os.path.abspath(options.out)), "techniques")
    os.makedirs(pictures, exist_ok=True)
    rows_path = os.path.join(pictures, "rows.json")
    rows = kept_rows(rows_path)
    for name, scene in scenes:
        if options.scenes and name not in options.scenes:
            continue
        with tempfile.TemporaryDirectory() as folder:
            rows[name] = measure(options.sheaf, name, scene, options.samples, folder, pictures)
        print(json.dumps(rows[name]), flush=True)
        with open(rows_path, "w", encoding="utf-8") as file:
            json.dump(list(rows.values()), file, indent=1)
            file.write("\n")
    with open(options.out, "w", encoding="utf-8") as file:
        file.write(page(list(rows.values())))


if __name__ == "__main__":
    main()
