#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Compares features of the pbrt-v4 format, one a scene, with closed forms.

    tests/features/features_test.py [--self-check] [--changed [CHANGE]] [--table] [--keep FOLDER]
                                    [NAME ...]

Each case is a scene of a few pixels. The expected value follows from pbrt-v4's documentation by the
forms of closed_forms.py; no renderer is asked. The scenes are frames of two runs of `sheaf render
--single-scattering`: those about spectra with --color spectral, and all others without its noise. A
case fails where a channel is off by more than 2 % of the expected value (of the largest pixel, for
images).

--self-check breaks cases by hand (broken.py): each of them must fail, or the test has no power.
--changed renders cases as changes.py rewrites them, turned, mirrored, moved and so on, for the same
values: with SHEAF_ALL_TESTS or NAMEs each case by every change that keeps its image, else every
second case by one of them, in turn.

--table prints every case; NAMEs select cases that contain one of them.

Needs Debian's python3-numpy and python3-openimageio, as the system's interpreter has them.
"""
import argparse
import collections
import os
import shutil
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(os.path.dirname(HERE), "integration"))
import farm  # noqa: E402  pylint: disable=wrong-import-position

try:
    import numpy as np
    import OpenImageIO as oiio
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(0)

import scenes  # noqa: E402  pylint: disable=wrong-import-position

TOLERANCE = 0.02
CASES_MIN = 300
RENDER_SECONDS_MAX = 120
FRAMES_MAX = 800  # In one run of the renderer.
# Smaller values count as 0 beside those of these scenes, which are about 1.
SMALL = 1e-3


def load_cases():
    for name in ("lights", "area_lights", "cameras", "films", "textures", "spectra", "transforms",
                 "shapes", "materials", "media", "paths", "spellings"):
        __import__("cases_" + name)
    names = collections.Counter(c.name for c in scenes.CASES)
    twice = [name for name, count in names.items() if count > 1]
    if twice:
        sys.exit(f"two cases of one name: {', '.join(twice)}")
    return scenes.CASES


def render(cases, folder):
    """Renders each case as a frame of its number, "0001.exr" and so on."""
    for i, c in enumerate(cases, 1):
        with open(os.path.join(folder, f"{c.color}.{i:04d}.pbrt"), "w", encoding="utf-8") as file:
            file.write(c.scene)
    for color in sorted({c.color for c in cases}):
        numbers_of_color = [str(i) for i, c in enumerate(cases, 1) if c.color == color]
        for begin in range(0, len(numbers_of_color), FRAMES_MAX):
            render_frames(color, numbers_of_color[begin:begin + FRAMES_MAX], cases, folder)


def render_frames(color, frames, cases, folder):
    command = [os.path.join(farm.programs(), "sheaf"), "render", f"{color}.####.pbrt", "--frames",
               ",".join(frames), "--single-scattering", "--color", color, "-o", "####.exr"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False,
                          stdin=subprocess.DEVNULL, timeout=RENDER_SECONDS_MAX * farm.PATIENCE)
    if done.returncode == 0:
        return
    if len(frames) > 1:
        # One by one, so that a scene that is refused hides no other.
        for frame in frames:
            if not os.path.exists(os.path.join(folder, f"{int(frame):04d}.exr")):
                render_frames(color, [frame], cases, folder)
        return
    reason = (done.stderr.strip().splitlines() or ["no reason is given"])[-1]
    print(f"{cases[int(frames[0]) - 1].name}: {reason}", flush=True)


def read(path, layer):
    """Pixels of R, G, B, or of another layer."""
    source = oiio.ImageInput.open(path)
    if source is None:
        return None
    names = list(source.spec().channelnames)
    wanted = {"RGB": ["R", "G", "B"]}.get(layer, [n for n in names if n.startswith(layer + ".")])
    pixels = np.asarray(source.read_image("float"), dtype=float)
    source.close()
    return pixels[..., [names.index(n) for n in wanted]]


def compare(c, pixels):
    """The deviation relative to what is expected, what was found and what was expected."""
    if c.pixels is not None:
        pixels = pixels[c.pixels]
    if c.want.ndim < 2:
        got, want = pixels.mean(axis=(0, 1)), np.broadcast_to(c.want, pixels.shape[-1:])
        scale = np.maximum(np.abs(want), 0.1 * np.abs(want).max())
    else:
        want = c.want if c.want.ndim == 3 else np.repeat(c.want[:, :, None], pixels.shape[-1], 2)
        if want.shape != pixels.shape:
            return np.inf, pixels.shape, want.shape
        got, scale = pixels, np.abs(want).max()
    if not np.isfinite(got).all():
        return np.inf, got, want
    allowed = np.maximum(scale, SMALL / TOLERANCE)
    return float((np.abs(got - want) / allowed).max()), got, want


def numbers(values):
    values = np.asarray(values, dtype=float)
    if values.ndim > 1:
        values = values.mean(axis=(0, 1))
    return " ".join(f"{v:.4f}" for v in values.ravel())


def run(cases, folder, table):
    """Renders and compares; returns the names of cases that are off."""
    render(cases, folder)
    off = []
    for i, c in enumerate(cases, 1):
        pixels = read(os.path.join(folder, f"{i:04d}.exr"), c.layer)
        deviation, got, want = (np.inf, [], []) if pixels is None else compare(c, pixels)
        is_off = not deviation <= TOLERANCE
        if is_off:
            off.append(c.name)
        if table or is_off:
            print(f"{'OFF' if is_off else 'ok ':3} {100 * deviation:8.2f} %  {c.name:52} "
                  f"{numbers(got)} for {numbers(want)}", flush=True)
    return off


def self_check(cases, folder):
    import broken  # pylint: disable=import-outside-toplevel
    by_name = {c.name: c for c in cases}
    changed = []
    for name, old, new in broken.CHANGES:
        c = by_name[name]
        if c.scene.count(old) != 1:
            sys.exit(f"{name}: \"{old}\" is not there once")
        changed.append(scenes.Case(name, c.scene.replace(old, new), c.want, c.layer, c.pixels))
    off = run(changed, folder, table=False)
    missed = [c.name for c in changed if c.name not in off]
    print(f"{len(off)} of {len(changed)} broken cases fail" +
          (f"; not seen: {', '.join(missed)}" if missed else ""))
    return 1 if missed else 0


def change(cases, wanted, is_short):
    """Cases as they are after changes that keep their images and whose names contain `wanted`."""
    import changes  # pylint: disable=import-outside-toplevel
    out = []
    for number, c in enumerate(cases):
        names = [n for n in changes.NAMES if wanted in n and changes.applies(n, c.scene, c.layer)]
        if is_short:
            names = [names[number // 2 % len(names)]] if number % 2 == 0 else []
        out += [scenes.Case(f"{c.name} ({name})", changes.changed(name, c.scene), c.want, c.layer,
                            c.pixels) for name in names]
    return out


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--self-check", action="store_true", help="cases broken by hand must fail")
    parser.add_argument("--changed", metavar="CHANGE", nargs="?", const="",
                        help="changes that keep the image; CHANGE: those with this text")
    parser.add_argument("--table", action="store_true", help="print every case")
    parser.add_argument("--keep", metavar="FOLDER", help="leave the scenes and images there")
    parser.add_argument("names", nargs="*", help="parts of names of cases")
    arguments = parser.parse_args()
    try:
        cases = load_cases()
        if arguments.self_check:
            return self_check(cases, scenes.FOLDER)
        if arguments.names:
            cases = [c for c in cases if any(n in c.name for n in arguments.names)]
        elif len(cases) < CASES_MIN:
            sys.exit(f"only {len(cases)} cases, where {CASES_MIN} are the least")
        if arguments.changed is not None:
            is_short = not (arguments.changed or arguments.names or
                            os.environ.get("SHEAF_ALL_TESTS"))
            cases = change(cases, arguments.changed, is_short)
        off = run(cases, scenes.FOLDER, arguments.table)
        print(f"{len(cases) - len(off)} of {len(cases)} features are as documented")
        return 1 if off else 0
    finally:
        if arguments.keep:
            shutil.copytree(scenes.FOLDER, arguments.keep, dirs_exist_ok=True)
        shutil.rmtree(scenes.FOLDER)


if __name__ == "__main__":
    sys.exit(main())
