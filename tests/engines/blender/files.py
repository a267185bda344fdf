#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Renders .blend files by Cycles and by the add-on, and prints a table of the differences.

  SHEAF_BIN=build/release/bin tests/engines/blender/files.py FOLDER --keep out

Prints, for each file below FOLDER: the differences of the means, how many 8 x 8 blocks are apart,
and what the report names. --keep has SCENE.png of each: Cycles, Sheaf and the difference. Exit code
1 if a file fails to render, or if it differs and the report names nothing.
"""
import argparse
import functools
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

import run

FILES_MAX = 1000
TRIXIE_VERSION = 403


@functools.cache
def installed_version():
    """The version of the Blender in PATH, as 304 of 3.4."""
    said = subprocess.run(["blender", "--version"], capture_output=True, text=True, check=True)
    major, minor = re.search(r"Blender (\d+)\.(\d+)", said.stdout).groups()
    return 100 * int(major) + int(minor)


def version_of(path):
    """The version of Blender that wrote a file, as 304 of 3.4; 0 where that is compressed."""
    with open(path, "rb") as file:
        header = file.read(12)
    return int(header[9:]) if header.startswith(b"BLENDER") and header[9:].isdigit() else 0


def render_file(bench, compare, path, name):
    """Whether the file passes: it renders, and what differs is named."""
    if version_of(path) > (TRIXIE_VERSION if bench.arguments.trixie else installed_version()):
        # Blender may crash while it reads such a file.
        print(f"newer  {name}: this Blender is older than the file", flush=True)
        return True
    noted = []
    for engine, samples in (("sheaf", bench.arguments.samples),
                            ("cycles", bench.arguments.cycles_samples)):
        said = bench.run(str(path), engine, samples, bench.folder / f"{name}.{engine}.exr",
                         script="file_in_blender.py")
        if "\nNEWER " in said:
            print(f"newer  {name}: this Blender is older than the file", flush=True)
            return True
        noted += re.findall(r"^Sheaf: (.*\((?:approximated|left out)\))$", said, re.M)
        of = re.search(r"^FILE_OF (.*)$", said, re.M)[1]
    differences = compare.compare(bench.folder, name)
    apart, blocks, largest = compare.blocks_apart(bench.folder, name)
    is_apart = not max(map(abs, differences)) <= run.MEAN_DIFFERENCE_MAX
    verdict = "SILENT" if is_apart and not noted else "named" if is_apart else "ok"
    print(f"{verdict:7}{name} ({of}): {', '.join(f'{100 * x:+.1f}' for x in differences)} %; "
          f"{apart} of {blocks} blocks apart, {100 * largest:.0f} % of the mean", flush=True)
    for line in noted:
        print("         ", line)
    return verdict != "SILENT"


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", type=pathlib.Path, nargs="+", help=".blend files, or folders")
    parser.add_argument("--samples", type=int, default=64, help="of Sheaf (default 64)")
    parser.add_argument("--cycles-samples", type=int, default=64)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--programs", type=pathlib.Path,
                        default=os.environ.get("SHEAF_BIN", run.ROOT / "build/release/bin"))
    parser.add_argument("--trixie", action="store_true", help="Blender 4.3, in a chroot")
    parser.add_argument("--keep", type=pathlib.Path, help="folder for images and PNGs")
    arguments = parser.parse_args()
    arguments.programs = pathlib.Path(arguments.programs).resolve()
    run.install()
    if arguments.trixie:
        run.install_trixie()
    if sys.executable != "/usr/bin/python3":  # Only Debian's Python sees its OpenImageIO.
        os.execv("/usr/bin/python3", ["/usr/bin/python3", *sys.argv])
    import compare
    folder = (arguments.keep or pathlib.Path(tempfile.mkdtemp(prefix="sheaf-blender-files-")))
    folder = folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    shutil.rmtree(folder / "user", ignore_errors=True)
    bench = run.Bench(arguments, folder)
    found = [path for each in arguments.files
             for path in (sorted(each.rglob("*.blend")) if each.is_dir() else [each])]
    failed = 0
    for path in found[:FILES_MAX]:
        name = re.sub(r"\W", "_", "_".join(path.with_suffix("").parts[-2:]))
        if arguments.trixie:  # The chroot has the bench's folder.
            path = pathlib.Path(shutil.copy(path, folder / f"{name}.blend"))
        try:
            failed += not render_file(bench, compare, path.resolve(), name)
        except (run.Failed, OSError, ValueError) as failure:
            failed += 1
            print(f"FAILED {name}: {failure}", flush=True)
    if not arguments.keep:
        shutil.rmtree(folder, ignore_errors=True)
    print(f"{len(found)} files, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
