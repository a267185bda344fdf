#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Prints a table of the cost of transferring scenes: many small files, a scene that has not
changed, a large file of which 1 % has changed, and one scene for eight workers.

    tests/bench/content_bench.py [--mib MIB] [--workers-mib MIB]

--mib: the large file, default 1024. --workers-mib: the scene of the eight workers, default 32: the
ratio does not depend on it.
"""
import argparse
import os
import struct
import sys
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "integration"))
import farm  # noqa: E402
from client_case import SCENE  # noqa: E402
from content_scene import write_scene  # noqa: E402

SMALL_FILES = 10_000
WORKERS = 8
SETTLED_SECONDS = 3  # After this a file's digest is remembered.
SECONDS_MAX = 600


def seconds_of(call):
    started = time.monotonic()
    call()
    return time.monotonic() - started


def row(what, value, target):
    print(f"{what:58} {value:>14}   target {target}", flush=True)


def submit(f, scene, *arguments):
    return seconds_of(lambda: f.sheaf("submit", scene, "--samples", 1, *arguments,
                                      seconds=SECONDS_MAX))


def small_files(f):
    """Files of a few bytes, all different, so that none is stored once for others."""
    folder = f.path("small")
    os.mkdir(folder)
    includes = ""
    for number in range(SMALL_FILES):
        with open(os.path.join(folder, f"{number}.pbrt"), "w", encoding="utf-8") as file:
            file.write(f"#{number}\n")
        includes += f'Include "{number}.pbrt"\n'
    scene = os.path.join(folder, "scene.pbrt")
    with open(scene, "w", encoding="utf-8") as file:
        file.write(SCENE + includes)
    row(f"{SMALL_FILES} small files, first submission", f"{submit(f, scene):.2f} s", "< 2 s")
    row("the same again", f"{submit(f, scene):.2f} s", "< 1 s")


def write_image(path, mib):
    """An uncompressed TGA of random texels."""
    width = 16384
    height = (mib << 20) // (4 * width)
    with open(path, "wb") as file:
        file.write(struct.pack("<BBBHHBHHHHBB", 0, 0, 2, 0, 0, 0, 0, 0, width, height, 32, 8))
        for _ in range(mib):
            file.write(os.urandom(1 << 20))


def large_file(f, mib):
    folder = f.path("large")
    os.mkdir(folder)
    image = os.path.join(folder, "image.tga")
    write_image(image, mib)
    scene = os.path.join(folder, "scene.pbrt")
    with open(scene, "w", encoding="utf-8") as file:
        head, shape = SCENE.split("Shape", 1)
        file.write(head + 'Texture "t" "spectrum" "imagemap" "string filename" "image.tga"\n'
                   'Material "diffuse" "texture reflectance" "t"\nShape' + shape)
    time.sleep(SETTLED_SECONDS)
    size = os.path.getsize(image)
    row(f"a file of {mib} MiB, first submission", f"{submit(f, scene):.2f} s", "-")
    row("the same again", f"{submit(f, scene):.2f} s", "< 1 s")
    before = f.metrics()["sheaf_content_received_bytes_total"]
    changed = size // 100
    with open(image, "r+b") as file:
        file.seek(size // 3)
        file.write(os.urandom(changed))
    seconds = submit(f, scene)
    sent = f.metrics()["sheaf_content_received_bytes_total"] - before
    row(f"1 % of it changed: sent, in {seconds:.2f} s", f"{100 * sent / size:.2f} %", "<= 3 %")


def eight_workers(mib):
    with farm.Farm() as f:
        scene, _ = write_scene(f.folder, [mib // 4] * 4)
        job = f.sheaf("submit", scene, "--samples", 1024, "--tile-size", 16, "--pass-samples",
                      32).stdout.strip()
        before = f.metrics()["sheaf_content_sent_bytes_total"]
        for number in range(WORKERS):
            f.start_worker(cache=f"cache{number}")
        f.sheaf("watch", job, seconds=SECONDS_MAX)

        def loaded():
            metrics = f.metrics()
            return sum(metrics[f'sheaf_content_blobs_total{{source="{source}"}}']
                       for source in ("peer", "coordinator")) >= 6 * WORKERS

        farm.wait_until(loaded, SECONDS_MAX, "all workers have the scene")
        sent = f.metrics()["sheaf_content_sent_bytes_total"] - before
        row(f"coordinator's bytes for {WORKERS} workers, per scene of {mib} MiB",
            f"{sent / (mib << 20):.2f}", "<= 2")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--mib", type=int, default=1024)
    parser.add_argument("--workers-mib", type=int, default=32)
    arguments = parser.parse_args()
    with farm.Farm() as f:
        f.environment["XDG_CACHE_HOME"] = f.path("home")
        small_files(f)
        large_file(f, arguments.mib)
    eight_workers(arguments.workers_mib)


if __name__ == "__main__":
    main()
