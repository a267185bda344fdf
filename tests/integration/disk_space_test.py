#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Small disks that each of the farm's writers fills in turn. Other jobs end with the same bytes, a
restart works, and the reason is shown.

The program runs itself again in a mount namespace of its own, so that nothing outside is touched.
"""
import contextlib
import hashlib
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.error
import urllib.request

import client_case
import farm

INSIDE = "SHEAF_INSIDE_MOUNT_NAMESPACE"
MEBI = 1 << 20
DISK_BYTES = 24 * MEBI
JOB = ("--tile-size", "16", "--pass-samples", "16", "--samples", "32")
# More than a test renders, in leases of some tenths of a second: their parts take little space.
LONG_JOB = ("--tile-size", "16", "--pass-samples", "1024", "--lease-passes", "1", "--samples",
            "16777216")
TOLD_SECONDS = 5


def free_bytes(folder):
    stat = os.statvfs(folder)
    return stat.f_bavail * stat.f_frsize


def padded(scene, size_bytes, seed=1):
    """The scene with a comment that pads it to this size."""
    bits = random.Random(seed)
    lines = [scene]
    size = len(scene)
    while size < size_bytes:
        lines.append("# " + bits.randbytes(512).hex() + "\n")
        size += len(lines[-1])
    return "".join(lines)


def fill(path, leave=0):
    """Writes another program's file, which takes all space but `leave` bytes."""
    with open(path, "wb") as file:
        with contextlib.suppress(OSError):
            while free_bytes(os.path.dirname(path)) > leave:
                file.write(b"x" * 4096)
                file.flush()


def files_below(folder):
    return [os.path.join(directory, name) for directory, _, names in os.walk(folder)
            for name in names]


class DiskSpaceTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        with tempfile.TemporaryDirectory() as folder:
            scene, image = os.path.join(folder, "scene.pbrt"), os.path.join(folder, "expected.exr")
            with open(scene, "w", encoding="utf-8") as file:
                file.write(client_case.SCENE)
            farm.render(scene, image, *JOB)
            cls.expected = farm.image_digest(image)

    def setUp(self):
        if os.environ.get(INSIDE) != "1":
            self.skipTest("no mount namespace may be made here: run as root")
        self.stack = contextlib.ExitStack()
        self.addCleanup(self.stack.close)
        self.folder = self.stack.enter_context(tempfile.TemporaryDirectory())
        self.scene = self.write("scene.pbrt", client_case.SCENE)

    def write(self, name, text):
        path = os.path.join(self.folder, name)
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)
        return path

    def mount(self, folder, size_bytes):
        os.makedirs(folder, exist_ok=True)
        subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size_bytes}", "tmpfs", folder],
                       check=True)
        self.stack.callback(subprocess.run, ["umount", "--lazy", folder], check=False)
        return folder

    @contextlib.contextmanager
    def farm_on_small_disk(self, *arguments):
        f = farm.Farm(arguments)
        self.mount(f.path("state"), DISK_BYTES)
        with f:
            yield f

    def submit(self, f, scene, *arguments):
        done = f.sheaf("submit", scene, *arguments, "--json")
        return json.loads(done.stdout.splitlines()[-1])["name"]

    def show(self, f, job):
        return json.loads(f.sheaf("show", job, "--json").stdout)

    def await_reason(self, f, job, *words):
        def told():
            reason = self.show(f, job)["waiting_reason"]
            return all(word in reason for word in words)
        farm.wait_until(told, TOLD_SECONDS, f"the reason of {job}: {words}")

    def check_other_job(self, f):
        """A job that needs little ends, with the same bytes as on a large disk. It is more urgent
        than long ones, which it would wait for.
        """
        out = os.path.join(self.folder, "out.exr")
        f.sheaf("submit", self.scene, *JOB, "--title", f"other {time.monotonic_ns()}",
                "--priority", "1", "--wait", "-o", out)
        self.assertEqual(farm.image_digest(out), self.expected)

    def restart(self, f, by=signal.SIGTERM):
        f.coordinator.send_signal(by)
        f.coordinator.wait(farm.START_SECONDS_MAX * farm.PATIENCE)
        f.start_coordinator()

    def await_samples(self, f, job):
        """The job gets on."""
        def done():
            return self.show(f, job)["progress"]["sample_count_done"]
        before = done()
        farm.wait_until(lambda: done() > before, 10, "more samples")

    # The coordinator's disk.

    def test_a_scene_that_does_not_fit_is_refused_before_its_first_byte(self):
        with self.farm_on_small_disk() as f:
            f.start_worker(threads=2)
            running = self.submit(f, self.scene, *LONG_JOB)
            self.await_samples(f, running)
            free = free_bytes(f.path("state"))
            for name, size in (("one.pbrt", 30 * MEBI), ("two.pbrt", 3 * MEBI)):
                scene = self.write(name, padded(client_case.SCENE, size))
                if name == "two.pbrt":  # A small file with a large one.
                    self.write("large.pbrt", padded("", 30 * MEBI, seed=2))
                    scene = self.write(name, padded(client_case.SCENE.replace(
                        "WorldBegin", 'WorldBegin\nInclude "large.pbrt"'), size))
                refused = f.sheaf("submit", scene, *JOB, check=False)
                self.assertEqual(refused.returncode, 1, refused.stderr)
                self.assertIn("free", refused.stderr)
                self.assertIn("--disk-free-min", refused.stderr)
                self.assertEqual(os.listdir(f.path("state", "content", "partial")), [])
                self.assertGreater(free_bytes(f.path("state")), free - 2 * MEBI)
            self.await_samples(f, running)
            self.check_other_job(f)
            self.restart(f)
            self.await_samples(f, running)

    def test_uploads_without_a_writer_go_first(self):
        with self.farm_on_small_disk() as f:
            f.start_worker()
            left = f.path("state", "content", "partial", hashlib.sha256(b"a").hexdigest() + ".part")
            with open(left, "wb") as file:
                file.write(b"x" * (15 * MEBI))
            scene = self.write("large.pbrt", padded(client_case.SCENE, 10 * MEBI))
            job = self.submit(f, scene, *JOB)
            self.assertFalse(os.path.exists(left))
            f.sheaf("watch", job, "-o", os.path.join(self.folder, "large.exr"))
            self.check_other_job(f)

    def post(self, f, path, body=b""):
        request = urllib.request.Request(f"http://{f.http}/api/v1/submissions{path}", body,
                                         {"X-Sheaf-Request": "1"})
        try:
            with urllib.request.urlopen(request, timeout=10 * farm.PATIENCE) as answer:
                return answer.status, json.load(answer)
        except urllib.error.HTTPError as error:
            with error:
                return error.code, json.load(error)

    def test_what_is_dropped_on_the_page_takes_the_space_of_uploads(self):
        """Regression: it left 2 GiB free, whatever the disk's size and --disk-free-min."""
        with self.farm_on_small_disk("--disk-free-min", "8M") as f:
            dropped = self.post(f, "")[1]["name"].partition("/")[2]
            code, taken = self.post(f, f"/{dropped}/files?name=a&offset=0", b"x" * MEBI)
            self.assertEqual(code, 200, taken)
            for number in range(1, DISK_BYTES // MEBI):
                code, refused = self.post(f, f"/{dropped}/files?name=a&offset={number * MEBI}",
                                          b"x" * MEBI)
                if code != 200:
                    break
            self.assertIn("free for uploads", refused["error"]["message"])
            self.assertIn("--disk-free-min", refused["error"]["message"])
            # --disk-free-min counts at most for a twentieth of a disk.
            self.assertGreater(free_bytes(f.path("state")), DISK_BYTES // 20)
            self.assertEqual(self.post(f, f"/{dropped}:discard")[0], 200)
            f.start_worker()
            self.check_other_job(f)

    def test_an_upload_that_the_disk_cannot_take_leaves_nothing(self):
        # Another program takes the space during the upload.
        with self.farm_on_small_disk() as f:
            scene = self.write("large.pbrt", padded(client_case.SCENE, 12 * MEBI))
            ballast = f.path("state", "ballast")
            partial = f.path("state", "content", "partial")
            upload = subprocess.Popen(
                [os.path.join(farm.programs(), "sheaf"), "submit", scene, *JOB],
                env=dict(f.environment, SHEAF_COORDINATOR=f.address, SHEAF_NO_QUOTE="1"),
                stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
            farm.wait_until(lambda: files_below(partial) or upload.poll() is not None, 20,
                            "the upload")
            fill(ballast)
            _, said = upload.communicate(timeout=60 * farm.PATIENCE)
            if upload.returncode != 0:  # Else the upload was faster.
                self.assertIn("No space left", said)
                self.assertEqual(files_below(partial), [])
            os.remove(ballast)
            f.start_worker()
            self.check_other_job(f)

    def test_a_disk_that_others_fill(self):
        with self.farm_on_small_disk() as f:
            f.start_worker(threads=2)
            running = self.submit(f, self.scene, *LONG_JOB)
            self.await_samples(f, running)
            ballast = f.path("state", "somebody.log")
            fill(ballast)
            self.await_reason(f, running, "not writable", "No space left")
            # Commands that free space work, and so do restarts.
            for by in (signal.SIGTERM, signal.SIGKILL, signal.SIGTERM):
                self.restart(f, by)
                f.sheaf("usage")
                f.sheaf("gc")
                f.sheaf("list")
            self.await_reason(f, running, "not writable", "No space left")
            f.sheaf("cancel", running)
            os.remove(ballast)
            self.check_other_job(f)

    def test_a_database_that_the_disk_cannot_take(self):
        with self.farm_on_small_disk("--disk-reserve", "0") as f:
            f.start_worker(threads=2)
            running = self.submit(f, self.scene, *LONG_JOB)
            self.await_samples(f, running)
            ballast = f.path("state", "somebody.log")
            refused = None
            while refused is None or refused.returncode == 0:  # Its log may have a page to spare.
                fill(ballast)
                refused = f.sheaf("pause" if refused is None else "resume", running, check=False)
            self.assertIn("disk is full", refused.stderr)
            self.assertIsNone(f.coordinator.poll())
            self.await_reason(f, running, "No space left")
            f.kill(f.coordinator)
            os.remove(ballast)
            f.start_coordinator()
            f.sheaf("resume", running)
            self.await_samples(f, running)
            self.check_other_job(f)

    def test_logs_that_the_disk_cannot_take(self):
        with farm.Farm() as f:
            f.log_file = "/dev/full"
            self.restart(f)
            f.start_worker()
            self.check_other_job(f)
            self.restart(f, signal.SIGKILL)
            self.check_other_job(f)

    def test_a_job_whose_parts_fill_the_disk(self):
        with self.farm_on_small_disk() as f:
            f.start_worker(threads=2)
            large = client_case.SCENE.replace('"integer xresolution" 48 "integer yresolution" 32',
                                              '"integer xresolution" 768 "integer yresolution" 512')
            self.assertNotEqual(large, client_case.SCENE)
            scene = self.write("many.pbrt", large)
            job = self.submit(f, scene, "--tile-size", "64", "--pass-samples", "1",
                              "--lease-passes", "1", "--samples", "4096")
            self.await_reason(f, job, "No space left")
            f.sheaf("usage")
            self.restart(f)
            self.await_reason(f, job, "No space left")
            f.sheaf("cancel", job)
            self.check_other_job(f)

    def test_an_image_that_does_not_fit(self):
        # Nor do its last parts.
        with self.farm_on_small_disk() as f:
            f.start_worker(threads=2)
            large = client_case.SCENE.replace('"integer xresolution" 48 "integer yresolution" 32',
                                              '"integer xresolution" 192 "integer yresolution" 192')
            ballast = f.path("state", "ballast")
            scene = self.write("image.pbrt", large)
            job = self.submit(f, scene, "--tile-size", "64", "--samples", "16",
                              "--pass-samples", "16", "--lease-passes", "1")
            farm.wait_until(lambda: f.metrics()["sheaf_results_accepted_total"] > 0, 30, "parts")
            fill(ballast)
            self.await_reason(f, job, "No space left")
            os.remove(ballast)
            f.sheaf("watch", job, "-o", os.path.join(self.folder, "image.exr"))
            local = os.path.join(self.folder, "local.exr")
            farm.render(scene, local, "--tile-size", "64", "--samples", "16", "--pass-samples",
                        "16", "--lease-passes", "1")
            self.assertEqual(farm.image_digest(os.path.join(self.folder, "image.exr")),
                             farm.image_digest(local))
            self.check_other_job(f)

    def test_a_start_on_a_disk_that_uploads_have_filled(self):
        # As the coordinator of an earlier version has left it.
        with self.farm_on_small_disk("--disk-reserve", "0") as f:
            f.start_worker(threads=2)
            running = self.submit(f, self.scene, *LONG_JOB)
            self.await_samples(f, running)
            f.kill(f.coordinator)
            left = f.path("state", "content", "partial", hashlib.sha256(b"b").hexdigest() + ".part")
            fill(left)
            f.start_coordinator()
            self.assertFalse(os.path.exists(left))
            self.await_samples(f, running)
            self.check_other_job(f)

    def test_an_image_beyond_the_limit_of_files(self):
        """Regression: SIGXFSZ ended the coordinator, without a word."""
        large = client_case.SCENE.replace('"integer xresolution" 48 "integer yresolution" 32',
                                          '"integer xresolution" 768 "integer yresolution" 512')
        scene = self.write("image.pbrt", large)
        settings = ("--tile-size", "128", "--samples", "1")
        f = farm.Farm(["--disk-reserve", "0"])
        f.coordinator_prefix = ["prlimit", f"--fsize={2 * MEBI}"]  # Enough for a part.
        with f:
            f.start_worker(threads=2)
            job = self.submit(f, scene, *settings)
            self.await_reason(f, job, "File too large")
            self.check_other_job(f)
            f.coordinator_prefix = []
            self.restart(f)
            f.sheaf("watch", job, "-o", os.path.join(self.folder, "image.exr"))
        local = os.path.join(self.folder, "local.exr")
        farm.render(scene, local, *settings)
        self.assertEqual(farm.image_digest(os.path.join(self.folder, "image.exr")),
                         farm.image_digest(local))

    # Disks of clients.

    def test_an_image_that_a_client_cannot_write(self):
        """Regression: SIGXFSZ ended it, without a word, and left a part of the image."""
        out = os.path.join(self.folder, "images")
        os.makedirs(out)
        image = os.path.join(out, "image.exr")
        with farm.Farm() as f:
            f.start_worker()
            f.client_prefix = ["prlimit", "--fsize=4096"]
            done = f.sheaf("submit", self.scene, *JOB, "--wait", "-o", image, check=False)
            self.assertEqual(done.returncode, client_case.FILE, done.stderr)
            self.assertIn(f"{image}: cannot be written (", done.stderr)
            self.assertIn("File too large", done.stderr)
            self.assertEqual(os.listdir(out), [])
            f.client_prefix = []
            f.sheaf("watch", "1", "-o", image)
            self.assertEqual(farm.image_digest(image), self.expected)

    def test_output_that_a_disk_does_not_take_is_no_success(self):
        with farm.Farm() as f, open("/dev/full", "wb") as full:
            job = self.submit(f, self.scene, *JOB)
            for command in (["list"], ["show", job, "--json"], ["--help"]):
                done = subprocess.run([os.path.join(farm.programs(), "sheaf"), *command],
                                      env=dict(f.environment, SHEAF_COORDINATOR=f.address),
                                      stdin=subprocess.DEVNULL, stdout=full,
                                      stderr=subprocess.PIPE, text=True, check=False)
                self.assertEqual(done.returncode, client_case.FILE, command)
                self.assertIn("standard output: not all could be written", done.stderr)


    def test_a_bundle_that_does_not_fit(self):
        disk = self.mount(os.path.join(self.folder, "disk"), 8 * MEBI)
        with farm.Farm() as f:
            f.start_worker()
            scene = self.write("large.pbrt", padded(client_case.SCENE, 14 * MEBI))
            job = self.submit(f, scene, *JOB)
            f.sheaf("watch", job)
            refused = f.sheaf("bundle", job, "--frame", "1", "--task", "0", "-o",
                              os.path.join(disk, "task.tar"), check=False)
            self.assertNotEqual(refused.returncode, 0)
            self.assertIn("space", refused.stderr)
            self.assertEqual(os.listdir(disk), [])
            self.check_other_job(f)

    # A worker's disk.

    def check_scene_larger_than_the_cache(self, f, needs, has):
        scene = self.write("large.pbrt", padded(client_case.SCENE, 14 * MEBI))
        self.check_other_job(f)
        job = self.submit(f, scene, *JOB)
        self.await_reason(f, job, "of scene cache", needs, has)
        listed = f.sheaf("list").stdout
        self.assertIn("of scene cache", listed)
        # It delays no other job.
        for _ in range(3):
            self.check_other_job(f)
        self.await_reason(f, job, "of scene cache")
        workers = json.loads(f.sheaf("workers", "--json").stdout.splitlines()[0])
        self.assertNotIn("sick", json.dumps(workers))
        return job

    def test_a_scene_larger_than_a_workers_disk(self):
        with farm.Farm() as f:
            disk = self.mount(f.path("cache"), 8 * MEBI)
            f.start_worker()
            job = self.check_scene_larger_than_the_cache(f, "14", "workers have")
            self.assertEqual([path for path in files_below(disk) if path.endswith(".part")], [])
            # A worker with a larger disk takes it.
            f.start_worker(cache="large cache")
            f.sheaf("watch", job, "-o", os.path.join(self.folder, "large.exr"))
            self.assertEqual(farm.image_digest(os.path.join(self.folder, "large.exr")),
                             self.expected)

    def test_a_scene_larger_than_a_workers_limit(self):
        with farm.Farm() as f:
            f.start_worker("--cache-bytes-max", "1M")
            self.check_scene_larger_than_the_cache(f, "14", "1 MiB")

    def test_a_workers_disk_that_others_fill(self):
        with farm.Farm() as f:
            disk = self.mount(f.path("cache"), 8 * MEBI)
            f.start_worker()
            ballast = os.path.join(disk, "ballast")
            fill(ballast)
            job = self.submit(f, self.scene, *JOB)
            self.await_reason(f, job, "of scene cache")
            # A worker that starts there says so too, and takes the job when there is space.
            f.kill(f.workers[0])
            fill(ballast)
            f.start_worker()
            farm.wait_until(lambda: "its file system has 0 left" in f.log("worker2"), 10,
                            "the worker's words")
            self.await_reason(f, job, "of scene cache")
            # Regression: a job that was alone was tried 200 times a second.
            self.assertLess(f.log("worker1").count("\n") + f.log("worker2").count("\n"), 50)
            os.remove(ballast)
            f.sheaf("watch", job, "-o", os.path.join(self.folder, "late.exr"))
            self.assertEqual(farm.image_digest(os.path.join(self.folder, "late.exr")),
                             self.expected)

    # TMPDIR of sheaf render.

    def render_in(self, disk, scene, output):
        return [os.path.join(farm.programs(), "sheaf"), "render", scene, "-o", output, *JOB], \
            dict(os.environ, TMPDIR=disk)

    def test_a_local_farm_holds_each_file_once(self):
        disk = self.mount(os.path.join(self.folder, "disk"), 20 * MEBI)
        scene = self.write("large.pbrt", padded(client_case.SCENE, 14 * MEBI))
        out = os.path.join(self.folder, "large.exr")
        command, environment = self.render_in(disk, scene, out)
        subprocess.run(command, env=environment, check=True, capture_output=True,
                       timeout=60 * farm.PATIENCE)
        self.assertEqual(farm.image_digest(out), self.expected)
        self.assertEqual(os.listdir(disk), [])

    def test_a_local_farm_that_does_not_fit_says_so(self):
        disk = self.mount(os.path.join(self.folder, "disk"), 8 * MEBI)
        scene = self.write("large.pbrt", padded(client_case.SCENE, 14 * MEBI))
        command, environment = self.render_in(disk, scene, os.path.join(self.folder, "large.exr"))
        done = subprocess.run(command, env=environment, check=False, capture_output=True, text=True,
                              timeout=60 * farm.PATIENCE)
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("free", done.stderr)
        self.assertIn("TMPDIR", done.stderr)
        self.assertEqual(os.listdir(disk), [])

    def test_what_a_killed_local_farm_leaves_goes_at_the_next_start(self):
        disk = os.path.join(self.folder, "tmp")
        os.makedirs(disk)
        command, environment = self.render_in(disk, self.scene, os.path.join(self.folder, "a.exr"))
        command[command.index("32")] = "1048576"
        killed = subprocess.Popen(command, env=environment, stdin=subprocess.DEVNULL,
                                  stderr=subprocess.DEVNULL)
        farm.wait_until(lambda: [path for path in files_below(disk) if "/parts/" in path], 30,
                        "parts")
        killed.kill()
        killed.wait()
        left = os.listdir(disk)
        self.assertEqual(len(left), 1)
        running = subprocess.Popen(command, env=environment, stdin=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL)
        self.addCleanup(running.wait)
        self.addCleanup(running.kill)
        farm.wait_until(lambda: [path for path in files_below(disk)
                                 if "/parts/" in path and left[0] not in path], 30, "parts")
        self.assertNotIn(left[0], os.listdir(disk))
        others = os.listdir(disk)
        command[command.index("1048576")] = "32"
        subprocess.run(command, env=environment, check=True, capture_output=True)
        self.assertEqual(os.listdir(disk), others, "one that runs keeps its own")


def run_inside():
    as_root = [] if os.geteuid() == 0 else ["--map-root-user"]
    inside = ["unshare", *as_root, "--mount"]
    with tempfile.TemporaryDirectory() as folder:
        try:
            may = subprocess.run([*inside, "mount", "-t", "tmpfs", "tmpfs", folder],
                                 capture_output=True, check=False).returncode == 0
        except FileNotFoundError:
            may = False
    os.environ[INSIDE] = "1" if may else "0"
    command = [sys.executable, *sys.argv]
    os.execvp("unshare" if may else command[0], [*inside, *command] if may else command)


if __name__ == "__main__":
    if INSIDE not in os.environ:
        run_inside()
    unittest.main(verbosity=2)
