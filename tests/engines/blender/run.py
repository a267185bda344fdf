#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Tests the Blender add-on in headless Blender: pictures against Cycles, Esc, frames,
images in the compositor, export time.

  SHEAF_BIN=build/release/bin tests/engines/blender/run.py
  tests/engines/blender/run.py --only lights,glass --samples 64 --keep out
  tests/engines/blender/run.py --trixie          # Blender 4.3 in a chroot that it makes

It installs what it needs (Debian's packages; needs root for that). Exit code 1 if a check fails.
"""
import argparse
import json
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[2]
sys.path.insert(0, str(ROOT / "tests" / "integration"))
from farm import free_port  # noqa: E402

PACKAGES = ("blender", "python3-numpy", "python3-openimageio", "python3-openvdb")
SCENES = ("lights", "principled", "coats", "textures", "normals", "glass", "emission", "world",
          "volumes", "instances", "hair", "motion", "lens", "mattes")
FINDINGS = (
    "smoke", "fog_around_camera", "camera_under_water", "scaled_to_nothing",
    "rounded_parents", "mirrored_camera",
    "spin", "acceleration", "blur_off", "zoom", "image_tiles", "image_missing", "image_none",
    "image_without_uv", "image_of_second_uv", "image_packed", "image_curves", "mix_clear_light",
    "add_clear_light",
    "mix_matt_light", "mix_matt_color", "add_number", "add_one", "mix_one", "world_moved",
    "world_of_object", "world_ball",
    "world_colors", "world_sky", "world_sky_hosek", "world_gradient", "world_hidden",
    "world_volume", "world_by_camera_ray", "world_by_camera_ray_rendered",
    "film_transparent", "film_exposure", "layer_override", "layer_without_sky", "spot_scaled",
    "grouped", "negative_lamps", "negative_in_group", "held_out", "dark_shine",
    "invisible_ones",
    "image_turned", "image_turned_back", "volumes_in_fog", "volumes_that_meet", "closed_room",
    "shells", "unclipped", "clipped", "clipped_near", "clipped_orthographic", "clipped_glass",
    "shutter_curve", "lamps_in_view", "lamp_around_all", "sun_in_view", "area_spread",
    "spot_soft",
    "rays_camera", "rays_shadow", "rays_diffuse", "rays_glossy", "rays_transmission", "rays_volume",
    "rays_indirect_only", "rays_world", "rays_principled", "lamps_in_mirror", "lamps_by_rays",
    "hidden_by_maker", "catcher_transparent", "catcher_over_sky", "catcher_under_light",
    "catcher_with_hidden")
PATTERNS = ("patterns_generated", "patterns_object", "patterns_uv", "patterns_position",
            "patterns_ramp", "patterns_line", "patterns_four", "patterns_combined",
            "patterns_of_colors", "colors_of_vertices", "colors_by_nodes")
PATTERNS_OF_4 = ("patterns_octaves", "patterns_fractals")  # Nodes that Blender has since 4.0.
RANDOM = tuple(f"handled{seed}" for seed in range(1, 201))  # From random_scenes.HandledScene.
WILD = tuple(f"wild{seed}" for seed in range(1, 201))  # From random_scenes.RandomScene.
MEAN_DIFFERENCE_MAX = 0.03  # Fraction of each channel's mean.
EXPORT_SECONDS_MAX = 10.0
SIGMAS_MAX = 4.0
START_SECONDS_MAX = 120
RENDER_SECONDS_MAX = 3600
CHROOT = pathlib.Path("/var/tmp/sheaf-blender-trixie")


class Failed(Exception):
    pass


def check(condition, message):
    print(("  ok: " if condition else "  FAILED: ") + message, flush=True)
    if not condition:
        raise Failed(message)


def install():
    missing = [p for p in PACKAGES if subprocess.run(
        ["dpkg-query", "-W", "-f", "${db:Status-Status}", p], capture_output=True,
        text=True, check=False).stdout != "installed"]
    if missing:
        subprocess.run(["apt-get", "install", "-y", "-q", "--no-install-recommends", *missing],
                       check=True)


def install_trixie():
    """A chroot of Debian 13 with its Blender; the repository and the programs are bound into it."""
    if not shutil.which("debootstrap"):
        subprocess.run(["apt-get", "install", "-y", "-q", "--no-install-recommends",
                        "debootstrap"], check=True)
    if not (CHROOT / "etc/debian_version").exists():
        subprocess.run(["debootstrap", "--variant=minbase", "trixie", CHROOT], check=True)
    rc = CHROOT / "usr/sbin/policy-rc.d"
    rc.write_text("#!/bin/sh\nexit 101\n")
    rc.chmod(0o755)
    shutil.copy("/etc/resolv.conf", CHROOT / "etc/resolv.conf")
    in_chroot("apt-get update -q && DEBIAN_FRONTEND=noninteractive apt-get install -y -q "
              "--no-install-recommends " + " ".join(PACKAGES))


def in_chroot(command, **more):
    mounts = "".join(f"mkdir -p {CHROOT}{path} && mount --bind {path} {CHROOT}{path} && "
                     for path in more.pop("binds", ()))
    return subprocess.run(["unshare", "-m", "sh", "-c", f"mount -t proc proc {CHROOT}/proc && "
                           f"{mounts} exec chroot {CHROOT} sh -c '{command}'"], check=True, **more)


def trixie_command(command, environment, folders):
    """The command that runs one in the chroot, with these folders of this machine."""
    binds = " ".join(f"mkdir -p '{CHROOT}{path}'; mount --bind '{path}' '{CHROOT}{path}';"
                     for path in folders)
    return ["unshare", "-m", "sh", "-c", f"mount -t proc proc {CHROOT}/proc; {binds} "
            f'exec chroot {CHROOT} env "$@"', "sh",
            *(f"{name}={value}" for name, value in environment.items()), *map(str, command)]


class Bench:
    """Runs Blender with the add-on, from a folder of its own."""

    def __init__(self, arguments, folder):
        self.arguments, self.folder = arguments, folder
        addons = folder / "user" / "addons"
        addons.mkdir(parents=True)
        shutil.copytree(ROOT / "blender" / "sheaf_blender", addons / "sheaf_blender")
        self.environment = {
            "BLENDER_USER_SCRIPTS": str(folder / "user"), "PYTHONDONTWRITEBYTECODE": "1",
            "SHEAF_BIN": str(arguments.programs), "SHEAF_TEST_CONTENT": str(folder / "content"),
            "THREADS": str(arguments.threads), "HOME": str(folder), "PATH": os.environ["PATH"]}

    def command(self, scene, engine, samples, output, script="in_blender.py"):
        return ["blender", "-b", "--factory-startup", "--python-exit-code", "3", "--python",
                str(HERE / script), "--", scene, engine, str(samples), str(output),
                str(self.folder)]

    def start(self, command, **extra):
        if self.arguments.trixie:
            command = trixie_command(command, {**self.environment, **extra},
                                     {ROOT, self.folder, self.arguments.programs})
        return subprocess.Popen(command, env={**os.environ, **self.environment, **extra},
                                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)

    def run(self, *command, script="in_blender.py", **extra):
        process = self.start(self.command(*command, script=script), **extra)
        try:
            said, _ = process.communicate(timeout=RENDER_SECONDS_MAX)
        except subprocess.TimeoutExpired:
            process.kill()
            raise Failed(f"{command[0]}: Blender did not end in {RENDER_SECONDS_MAX} s") from None
        if process.returncode != 0 or "Traceback" in said:
            raise Failed(f"{command[0]} with {command[1]}: Blender failed:\n{said[-3000:]}")
        return said


def pictures(bench, compare):
    failed = []
    subprocess.run(["/usr/bin/python3", HERE / "make_cloud.py", bench.folder / "cloud.vdb"],
                   check=True)
    usual = SCENES + FINDINGS + PATTERNS + (PATTERNS_OF_4 if bench.arguments.trixie else ())
    for scene in bench.arguments.only or usual:
        print(scene, flush=True)
        try:
            said = bench.run(scene, "sheaf", bench.arguments.samples,
                             bench.folder / f"{scene}.sheaf.exr")
            noted = re.findall(r"^Sheaf: (.*\((?:approximated|left out)\))$", said, re.M)
            for line in noted:
                print("   ", line)
            bench.run(scene, "cycles", bench.arguments.cycles_samples,
                      bench.folder / f"{scene}.cycles.exr")
            found = compare.compare(bench.folder, scene)
            is_named = scene.startswith("wild") and bool(noted)
            check(max(map(abs, found)) <= MEAN_DIFFERENCE_MAX or is_named, f"{scene}: means differ "
                  f"by {', '.join(f'{100 * x:+.2f}' for x in found)} %")
            alpha = compare.alpha_difference(bench.folder, scene)
            check(alpha <= MEAN_DIFFERENCE_MAX or is_named, f"{scene}: alpha differs by "
                  f"{100 * alpha:.2f} % of a pixel on average")
            apart, blocks, largest = compare.blocks_apart(bench.folder, scene)
            named = ", which the report names" if apart and noted else ""
            check(apart == 0 or noted, f"{scene}: {apart} of {blocks} blocks are apart, by up to "
                  f"{100 * largest:.0f} % of the mean{named}")
        except Failed as failure:
            failed.append(str(failure))
            print("  FAILED:", failure, flush=True)
    return failed


def protocol(bench, compare):
    """View layers, groups of lights, both eyes, sizes and regions."""
    print("protocol", flush=True)
    samples = bench.arguments.samples
    for what, endings in (("layers", ("",)), ("groups", ("",)), ("eyes", ("_L", "_R"))):
        for engine in ("cycles", "sheaf"):
            bench.run(what, engine, samples, bench.folder / f"{what}.{engine}.exr",
                      script="protocol_in_blender.py")
        for ending in endings:
            first, second = (compare.read_all(bench.folder / f"{what}.{engine}{ending}.exr")
                             for engine in ("cycles", "sheaf"))
            check(set(first) == set(second), f"{what}{ending}: the channels are {sorted(second)}")
            for name, pixels in first.items():
                difference = abs(pixels - second[name]).mean()
                if what == "groups":  # Lamps without size are noisy.
                    difference = abs(pixels.mean() - second[name].mean())
                apart = difference / pixels.mean()
                check(apart < MEAN_DIFFERENCE_MAX, f"{what}{ending}: pixels of {name} are "
                      f"{100 * apart:.2f} % apart")
    said = bench.run("sizes", "sheaf", 4, bench.folder / "sizes.exr",
                     script="protocol_in_blender.py")
    check("SIZES_OK" in said, "sizes and regions have no black edge")


class Farm:
    """A coordinator and a worker on free ports of loopback."""

    def __init__(self, programs, folder):
        self.address, self.http = (free_port() for _ in range(2))
        self.programs = programs
        self.processes = [subprocess.Popen(
            [programs / "sheaf-coordinator", "--listen", f"127.0.0.1:{self.address}", "--http",
             f"127.0.0.1:{self.http}", "--state-dir", folder / "state"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)]
        self.wait()
        self.processes.append(subprocess.Popen(
            [programs / "sheaf-worker", "--coordinator", f"127.0.0.1:{self.address}", "--threads",
             "1", "--cache-dir", folder / "cache"], stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL))

    def wait(self):
        end = time.monotonic() + START_SECONDS_MAX
        while time.monotonic() < end:
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", self.address)) == 0:
                    return
            time.sleep(0.1)
        raise Failed("the coordinator does not answer")

    def environment(self):
        return {"SHEAF_TEST_FARM": f"127.0.0.1:{self.address}",
                "SHEAF_TEST_HTTP_PORT": str(self.http)}

    def jobs(self):
        listed = subprocess.run([self.programs / "sheaf", "list", "--json", "--coordinator",
                                 f"127.0.0.1:{self.address}"], capture_output=True, text=True,
                                check=True).stdout
        return [json.loads(line) for line in listed.splitlines()]

    def stop(self):
        for process in reversed(self.processes):
            process.terminate()
            process.wait()


def farm_checks(bench, compare):
    print("farm", flush=True)
    (bench.folder / "farm").mkdir()
    farm = Farm(bench.arguments.programs, bench.folder / "farm")
    try:
        said = bench.run("lights", "sheaf", 32, bench.folder / "farm.exr", **farm.environment())
        check(re.search(r"Sheaf: [1-9]\d* previews shown", said), "tiles are shown while the farm "
              "renders")
        check([job["state"] for job in farm.jobs()] == ["succeeded"], "one job has succeeded")
        local = bench.folder / "local.exr"
        bench.run("lights", "sheaf", 32, local)
        check(compare.same_pixels(local, bench.folder / "farm.exr"),
              "the farm's image is that of this machine, to the bit")
        cancel(bench, farm)
        frames(bench, farm)
    finally:
        farm.stop()


def operators(bench):
    print("operators", flush=True)
    (bench.folder / "operators").mkdir()
    farm = Farm(bench.arguments.programs, bench.folder / "operators")
    try:
        said = bench.run("animation", "sheaf", 16, bench.folder / "button",
                         script="operators_in_blender.py", **farm.environment())
        check("OPERATORS_OK" in said, "each button of the panels works, or says why not")
        left = [job for job in farm.jobs() if job["state"] not in ("succeeded", "cancelled")]
        check(not left, "they leave no job")
    finally:
        farm.stop()


def cancel(bench, farm):
    """SIGINT is Esc to a Blender without window: both set the flag that test_break() reads."""
    for waits_for in ("running", "submitting"):
        before = len(farm.jobs())
        process = bench.start(bench.command("lights", "sheaf", 65536, bench.folder / "never.exr"),
                              **farm.environment())
        end = time.monotonic() + START_SECONDS_MAX
        marker = "Sheaf: exported" if waits_for == "submitting" else None
        for line in process.stdout:
            if marker and marker in line:
                break
            if not marker and "Sheaf: exported" in line:
                while len(farm.jobs()) == before and time.monotonic() < end:
                    time.sleep(0.2)
                time.sleep(1.0)
                break
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=START_SECONDS_MAX)
        left = [job for job in farm.jobs() if job["state"] not in ("succeeded", "cancelled")]
        check(not left, f"Esc while {waits_for} leaves no job")


def frames(bench, farm):
    process = bench.start(bench.command("animation", "sheaf", 16, bench.folder / "shot",
                                        "frames_in_blender.py"), **farm.environment())
    said, _ = process.communicate(timeout=RENDER_SECONDS_MAX)
    check(process.returncode == 0 and "FRAMES_OK" in said,
          "four frames are one job, and their images arrive" if process.returncode == 0
          else said[-2000:])
    newest = farm.jobs()[0]
    check(newest["state"] == "succeeded", f"{newest['name']} has succeeded")


def export_time(bench):
    print("export of 10^6 triangles and 10^5 instances", flush=True)
    process = bench.start(bench.command("big", "sheaf", 1, bench.folder / "big.pbrt",
                                        "export_in_blender.py"))
    said, _ = process.communicate(timeout=RENDER_SECONDS_MAX)
    found = re.findall(r"Sheaf: exported in ([\d.]+) s \(([\d.]+) s of CPU time\); (\d+) files "
                       r"written", said)
    check(len(found) == 2, f"it is exported twice {'' if len(found) == 2 else said[-1500:]}")
    for wall, cpu, written in found:
        print(f"  {wall} s, {cpu} s of CPU time, {written} files written")
    check(float(found[0][0]) < EXPORT_SECONDS_MAX,
          f"an export takes less than {EXPORT_SECONDS_MAX:.0f} s")
    check(found[1][2] == "0", "meshes that have not changed are not written again")


MATTES = """LookAt 0 -6 0  0 0 0  0 0 1
Camera "perspective" "float fov" 40
Film "rgb" "integer xresolution" 96 "integer yresolution" 64
WorldBegin
LightSource "infinite"
Material "diffuse"
AttributeBegin Translate 1.2 0 0
Shape "sphere" "float radius" 0.8 "string name" "Left ball" AttributeEnd
ObjectBegin "ball" Shape "sphere" "float radius" 0.8 ObjectEnd
AttributeBegin Translate -1.2 0 0 ObjectInstance "ball" "string name" "Right ball" AttributeEnd
"""
MATTE_SPOTS = {"Left ball": (30, 32), "Right ball": (65, 32)}  # Centers, in pixels.


def exr_checks(bench, compare):
    """Blender opens Sheaf's files, and its Cryptomatte node finds objects by their names."""
    print("exr", flush=True)
    scene = bench.folder / "mattes.pbrt"
    scene.write_text(MATTES, "utf-8")
    for form in ([], ["--exr-type", "half", "--exr-parts", "multi"]):
        image = bench.folder / f"mattes{len(form)}.exr"
        subprocess.run([bench.arguments.programs / "sheaf", "render", scene, "--samples", "16",
                        "--cryptomatte", "object,material", "--aov", "position,uv,object-id", "-o",
                        image, *form], check=True, stderr=subprocess.DEVNULL)
        for name, spot in MATTE_SPOTS.items():
            matte = bench.folder / "matte.exr"
            said = bench.run(str(image), name, "96x64", matte, script="read_in_blender.py")
            wrong = [line for line in said.splitlines()
                     if "multilayer read" in line or "no rect" in line]
            check(not wrong, f"Blender knows all channels of {image.name} {wrong[:3]}")
            found = compare.read(matte)[:, :, 0]
            others = [found[y, x] for other, (x, y) in MATTE_SPOTS.items() if other != name]
            check(found[spot[1], spot[0]] > 0.99 and max(others) < 0.01,
                  f'the matte "{name}" of {image.name} covers that object alone')


def passes(bench):
    """F12 with all passes, by Sheaf and by Cycles."""
    import passes_checks
    print("passes", flush=True)
    images, picked = {}, "Right ball"
    for engine in ("sheaf", "cycles"):
        path = bench.folder / f"passes.{engine}.exr"
        bench.run(picked, engine, "64",
                  path, script="passes_in_blender.py")
        images[engine], attributes = passes_checks.read(path)
        if engine == "sheaf":
            passes_checks.check_geometry(images["sheaf"], check)
            passes_checks.check_light(images["sheaf"], check)
        passes_checks.check_mattes(images[engine], attributes, picked, check)
    passes_checks.check_like_cycles(images["sheaf"], images["cycles"], check)


def guided(bench, compare):
    """Guided paths find the light of paths from the camera where rays of some kinds see less."""
    print("guided paths with Ray Visibility", flush=True)
    for scene in ("rays_diffuse", "rays_glossy", "rays_indirect_only", "rays_principled",
                  "lamps_by_rays", "clipped_glass"):
        path = bench.folder / f"{scene}.pbrt"
        bench.run(scene, "sheaf", 1, path, script="export_in_blender.py")
        found = []
        for techniques in ("camera", "camera+guiding"):
            image = bench.folder / f"{scene}.{techniques}.exr"
            subprocess.run([bench.arguments.programs / "sheaf", "render", path, "--samples",
                            str(bench.arguments.samples), "--techniques", techniques, "--threads",
                            str(bench.arguments.threads), "-o", image], check=True,
                           stderr=subprocess.DEVNULL)
            found.append(compare.mean_and_error(image))
        (camera, error), (guided_mean, guided_error) = found
        sigmas = abs(guided_mean - camera) / (error**2 + guided_error**2) ** 0.5
        check(sigmas < SIGMAS_MAX, f"{scene}: means {camera:.5f} and {guided_mean:.5f} are "
              f"{sigmas:.1f} standard errors apart ({100 * (guided_mean / camera - 1):+.2f} %)")


def gltf(bench, compare, only):
    import gltf_against_cycles
    print("glTF", flush=True)
    failed = gltf_against_cycles.check_models(bench, compare, only)
    if failed:
        raise Failed("; ".join(failed))


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", type=lambda t: t.split(","),
                        help="scenes, or findings, random, wild, protocol, guided, gltf, passes, "
                        "exr, farm, operators, export")
    parser.add_argument("--models", type=lambda t: t.split(","), help="of glTF, to compare")
    parser.add_argument("--samples", type=int, default=1024, help="of Sheaf (default 1024)")
    parser.add_argument("--cycles-samples", type=int, default=1024)
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--programs", type=pathlib.Path,
                        default=os.environ.get("SHEAF_BIN", ROOT / "build/release/bin"))
    parser.add_argument("--keep", type=pathlib.Path, help="folder for images and PNGs")
    parser.add_argument("--trixie", action="store_true", help="Blender 4.3, in a chroot")
    arguments = parser.parse_args()
    arguments.programs = pathlib.Path(arguments.programs).resolve()
    install()
    if arguments.trixie:
        install_trixie()
    if sys.executable != "/usr/bin/python3":  # Only Debian's Python sees its OpenImageIO.
        os.execv("/usr/bin/python3", ["/usr/bin/python3", *sys.argv])
    import compare
    folder = arguments.keep or pathlib.Path(tempfile.mkdtemp(prefix="sheaf-blender-test-"))
    folder = folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    shutil.rmtree(folder / "user", ignore_errors=True)
    for name in ("farm", "operators"):
        shutil.rmtree(folder / name, ignore_errors=True)
    bench = Bench(arguments, folder)
    chosen = arguments.only or []
    failed = []
    steps = {"protocol": lambda: protocol(bench, compare),
             "gltf": lambda: gltf(bench, compare, arguments.models),
             "guided": lambda: guided(bench, compare),
             "passes": lambda: passes(bench), "exr": lambda: exr_checks(bench, compare),
             "farm": lambda: farm_checks(bench, compare),
             "operators": lambda: operators(bench), "export": lambda: export_time(bench)}
    arguments.only = [name for each in chosen if each not in steps
                      for name in {"findings": FINDINGS, "random": RANDOM, "wild": WILD}.get(
                          each, (each,))]
    if arguments.only or not chosen:
        failed += pictures(bench, compare)
    for name, step in steps.items():
        if not chosen or name in chosen:
            try:
                step()
            except Failed as failure:
                failed.append(str(failure))
    if not arguments.keep:
        shutil.rmtree(folder, ignore_errors=True)
    print("\n".join(["FAILED:", *failed]) if failed else "all checks passed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
