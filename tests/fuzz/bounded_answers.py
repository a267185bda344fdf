#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Each file of the fuzzers' corpora gets an answer within 2 GiB of memory and 10 CPU seconds.

Usage: bounded_answers.py [--all] [FOLDER]...

Scenes, and the files that scenes name, go to "sheaf plan"; images of frames and bundles to the
commands that read them; messages to fuzz_replay. An answer is an exit code of docs/using.md and,
unless that is 0, a message: no signal, and no end by a limit. Without --all the first file of each
corpus stands for the others. FOLDER: scenes below it (.pbrt, .gltf, .glb) are planned in place, all
of them. SHEAF_BIN is the folder of the programs.
"""
import argparse
import concurrent.futures
import os
import resource
import shutil
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
BIN = os.environ.get("SHEAF_BIN", os.path.join(ROOT, "build", "release", "bin"))
ADDRESS_SPACE_BYTES_MAX = 2 << 30
CPU_SECONDS_MAX = 10
WALL_SECONDS_MAX = 20 * CPU_SECONDS_MAX  # Ends what waits for something that never comes.
EXIT_CODES = range(8)
SCENE_ENDINGS = (".pbrt", ".gltf", ".glb")

HEAD = 'Film "rgb" "integer xresolution" 16 "integer yresolution" 16\n'
WORLD = 'WorldBegin\nLightSource "infinite"\n'
# A file's name, and the scene that names it.
SCENES = {
    "ply": ("a.ply", HEAD + WORLD + 'Shape "plymesh" "string filename" "a.ply"\n'),
    "lens": ("a.dat", 'Camera "realistic" "string lensfile" "a.dat"\n' + HEAD + WORLD),
    "spectrum": ("a.spd", HEAD + WORLD +
                 'Material "diffuse" "spectrum reflectance" "a.spd"\nShape "sphere"\n'),
    "ies": ("a.ies", HEAD + WORLD + 'LightSource "goniometric" "string filename" "a.ies"\n'),
    "measured": ("a.bsdf", HEAD + WORLD +
                 'Material "measured" "string filename" "a.bsdf"\nShape "sphere"\n'),
    "volume": ("a.nvdb", HEAD + WORLD + 'MakeNamedMedium "m" "string type" "nanovdb" '
               '"string filename" "a.nvdb"\nMediumInterface "m" ""\nMaterial "interface"\n'
               'Shape "sphere"\n'),
    "pages": ("a.pages", HEAD + WORLD + 'MakeNamedMedium "m" "string type" "nanovdb" '
              '"string filename" "a.pages"\nMediumInterface "m" ""\nMaterial "interface"\n'
              'Shape "sphere"\n'),
    "vdb": ("a.vdb", HEAD + WORLD + 'Shape "levelset" "string filename" "a.vdb"\n'),
}
TEXTURE = (HEAD + WORLD + 'Texture "t" "spectrum" "imagemap" "string filename" "{0}"\n'
           'Material "diffuse" "texture reflectance" "t"\nShape "sphere"\n'
           'LightSource "projection" "string filename" "{0}"\n')
IMAGE_ENDINGS = ("exr", "png", "hdr", "pfm", "jpg", "tif", "tga")  # As image_fuzz.cc has them.
MESH = ("ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")


def write(folder, name, content):
    path = os.path.join(folder, name)
    with open(path, "wb") as file:
        file.write(content if isinstance(content, bytes) else content.encode())
    return path


def plan_of(folder, text):
    return ["sheaf", "plan", write(folder, "main.pbrt", text)]


def command_for(target, path, folder):
    """The command that reads a file of a corpus, with what it needs in folder."""
    with open(path, "rb") as file:
        content = file.read()
    if target == "scene":
        write(folder, "a.pbrt", "Translate 1 0 0\n")
        write(folder, "m.ply", MESH)
        return ["sheaf", "plan", write(folder, "main.pbrt", content)]
    if target == "gltf":
        write(folder, "a.bin", bytes(256))
        write(folder, "a.png", b"\x89PNG")
        name = "main.glb" if content.startswith(b"glTF") else "main.gltf"
        return ["sheaf", "plan", write(folder, name, content)]
    if target == "image":
        name = "a." + IMAGE_ENDINGS[(content[0] if content else 0) % len(IMAGE_ENDINGS)]
        write(folder, name, content[1:])
        return plan_of(folder, TEXTURE.format(name))
    if target in SCENES:
        name, text = SCENES[target]
        write(folder, name, content)
        return plan_of(folder, text)
    if target == "frame_image":
        return ["sheaf", "error", write(folder, "a.exr", content)]
    if target == "bundle":
        return ["sheaf", "repro", "--no-sandbox", write(folder, "a.tar", content)]
    os.mkdir(os.path.join(folder, target))
    write(os.path.join(folder, target), "file", content)
    return ["fuzz_replay", "--target", target, folder]


def limit():
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE_BYTES_MAX, ADDRESS_SPACE_BYTES_MAX))
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_SECONDS_MAX, CPU_SECONDS_MAX + 1))


def fault_of(command, folder):
    """Runs a command with limits; what is wrong with its answer, or nothing."""
    try:
        done = subprocess.run([os.path.join(BIN, command[0]), *command[1:]], cwd=folder,
                              stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, preexec_fn=limit, check=False,
                              timeout=WALL_SECONDS_MAX)
    except subprocess.TimeoutExpired:
        return f"no answer within {WALL_SECONDS_MAX} s"
    said = done.stderr.decode(errors="replace").strip()
    if done.returncode not in EXIT_CODES:
        return f"exit code {done.returncode}: {said[-300:]}"
    if done.returncode != 0 and not said:
        return f"exit code {done.returncode} without a message"
    return None


def check_corpus_file(target, path):
    with tempfile.TemporaryDirectory(prefix="sheaf_bounded_") as folder:
        return fault_of(command_for(target, path, folder), folder)


def check_scene(path):
    return fault_of(["sheaf", "plan", path], os.path.dirname(path) or ".")


def corpus_files(everything):
    """Pairs of a target and a file."""
    for corpus in ("corpus", "regressions"):
        for target in sorted(os.listdir(os.path.join(HERE, corpus))):
            folder = os.path.join(HERE, corpus, target)
            names = sorted(os.listdir(folder))
            for name in names if everything else names[:1]:
                yield target, os.path.join(folder, name)


def generated_files(folder):
    """The corpora of volume, vdb and pages, which are too large for the repository."""
    program = os.path.join(BIN, "volume_seeds")
    if not os.path.exists(program):
        print("volume_seeds is not built: no volumes")
        return
    subprocess.run([program, folder], check=True, stdout=subprocess.DEVNULL)
    for target in ("volume", "vdb", "pages"):
        for name in sorted(os.listdir(os.path.join(folder, target))):
            yield target, os.path.join(folder, target, name)


def scenes_below(folder):
    for place, _, names in sorted(os.walk(folder)):
        for name in sorted(names):
            if name.endswith(SCENE_ENDINGS):
                yield os.path.abspath(os.path.join(place, name))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--all", action="store_true", help="every file of every corpus")
    parser.add_argument("-j", type=int, default=os.cpu_count(), help="files at a time")
    parser.add_argument("folders", nargs="*", metavar="FOLDER", help="with scenes")
    arguments = parser.parse_args()
    seeds = tempfile.mkdtemp(prefix="sheaf_bounded_")
    try:
        files = list(corpus_files(arguments.all))
        if arguments.all:
            files += generated_files(seeds)
        scenes = [path for folder in arguments.folders for path in scenes_below(folder)]
        with concurrent.futures.ThreadPoolExecutor(arguments.j) as pool:
            faults = list(pool.map(lambda pair: check_corpus_file(*pair), files))
            faults += pool.map(check_scene, scenes)
    finally:
        shutil.rmtree(seeds)
    failed = 0
    for path, fault in zip([path for _, path in files] + scenes, faults):
        if fault is not None:
            failed += 1
            print(f"{path}: {fault}")
    print(f"{len(faults)} files, {failed} without an answer within "
          f"{ADDRESS_SPACE_BYTES_MAX >> 30} GiB and {CPU_SECONDS_MAX} CPU seconds")
    return 1 if failed or not faults else 0


if __name__ == "__main__":
    sys.exit(main())
