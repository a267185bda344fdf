#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Renders all glTF and USD models below folders small, as one picture, and counts what happened.

    tests/gltf/contact_sheet.py SHEAF SHEET.png FOLDER ... [--size 96] [--samples 8] [--limit N]

SHEAF is a build's program `sheaf`. Each model is rendered, refused with a message that begins with
its name, or has crashed, which includes ends by a signal, timeouts and refusals without a message.
Models of glTF 1.0 count as refused. Beside the picture, SHEET.txt has a line for each model, with
its place (column, row) in the picture. Ends with the counts, and with status 1 after a crash.
Pictures are joined by Debian's python3-openimageio.
"""
import argparse
import os
import subprocess
import sys
import tempfile

import OpenImageIO as oiio

ENDINGS = (".glb", ".gltf", ".usd", ".usda", ".usdc", ".usdz")
SECONDS_MAX = 300
EXITS_OF_REFUSAL = (4, 6)  # A scene with errors; a file that is missing.
COLUMNS = 12


def models_of(folders):
    """The paths of all models, sorted by name within each folder."""
    found = []
    for folder in folders:
        paths = [os.path.join(parent, name) for parent, _, names in os.walk(folder)
                 for name in names if name.lower().endswith(ENDINGS)]
        found += sorted(paths)
    return found


def render(options, model, png):
    """Returns "rendered", "refused" or "crashed", and the words that say why."""
    command = [options.sheaf, "render", model, "--size", f"{options.size}x{options.size}",
               "--samples", str(options.samples), "--exposure", "auto", "-o", png]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS_MAX,
                              check=False)
    except subprocess.TimeoutExpired:
        return "crashed", f"took more than {SECONDS_MAX} s"
    if done.returncode == 0:
        return "rendered", ""
    words = [line for line in done.stderr.splitlines() if os.path.basename(model) in line]
    if done.returncode in EXITS_OF_REFUSAL and words:
        return "refused", words[0].replace(os.path.dirname(model) + "/", "")
    return "crashed", f"exit code {done.returncode}: {done.stderr.strip()[-200:]}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("sheaf", help="the program sheaf")
    parser.add_argument("sheet", help="the picture to write")
    parser.add_argument("folders", nargs="+", help="folders of models")
    parser.add_argument("--size", type=int, default=96, help="edge of each model, pixels (96)")
    parser.add_argument("--samples", type=int, default=8, help="a pixel (default 8)")
    parser.add_argument("--limit", type=int, default=10000, help="models at most")
    options = parser.parse_args()
    models = models_of(options.folders)[:options.limit]
    if not models:
        sys.exit("no models: " + " ".join(options.folders))
    rows = -(-len(models) // COLUMNS)
    sheet = oiio.ImageBuf(oiio.ImageSpec(COLUMNS * options.size, rows * options.size, 3,
                                         oiio.UINT8))
    counts = {"rendered": 0, "refused": 0, "crashed": 0}
    base = os.path.commonpath([os.path.abspath(folder) for folder in options.folders])
    with tempfile.TemporaryDirectory() as folder, \
            open(os.path.splitext(options.sheet)[0] + ".txt", "w", encoding="utf-8") as report:
        for at, model in enumerate(models):
            png = os.path.join(folder, "model.png")
            what, words = render(options, model, png)
            counts[what] += 1
            column, row = at % COLUMNS, at // COLUMNS
            if what == "rendered":
                oiio.ImageBufAlgo.paste(sheet, column * options.size, row * options.size, 0, 0,
                                        oiio.ImageBuf(png))
            name = os.path.relpath(os.path.abspath(model), base)
            print(f"{column:2} {row:2} {what} {name} {words}".rstrip(), file=report, flush=True)
            if at % COLUMNS == COLUMNS - 1 or at == len(models) - 1:
                sheet.write(options.sheet)  # So that an interruption loses little.
    print(f"{len(models)} models: " + ", ".join(f"{n} {what}" for what, n in counts.items()))
    sys.exit(1 if counts["crashed"] else 0)


if __name__ == "__main__":
    main()
