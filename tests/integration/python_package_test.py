#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The package of python/: built, type-checked, and used with farms of real processes.

Needs Debian's python3-grpcio, python3-numpy, python3-openimageio and mypy, which the system's
interpreter sees: /usr/bin/python3.
"""
import glob
import logging
import os
import re
import shutil
import stat
import subprocess
import sys
import tempfile
import unittest
from unittest import mock

try:
    import grpc  # The package's dependencies, looked for first: their absence has a remedy.
    import numpy
    import OpenImageIO  # noqa: F401
except ImportError as missing:
    sys.exit(f"{sys.executable}: {missing}; run deploy/install-packages test, and this test with "
             "/usr/bin/python3")

import farm as farms
from client_case import SCENE
from package_build import PACKAGE, build_package
from secure_farm_test import SecureFarm

FEW, MANY = 16, 1 << 20
WAIT_SECONDS = 60 * farms.PATIENCE


def setUpModule():
    global sheaf, BUILT
    BUILT = build_package()
    sys.path.insert(0, BUILT)
    import sheaf
    logging.getLogger("sheaf").addHandler(logging.NullHandler())


def write_scene(folder, name, more=""):
    path = os.path.join(folder, name)
    with open(path, "w", encoding="utf-8") as file:
        file.write(SCENE + more)
    return path


class PackageTest(unittest.TestCase):
    def test_types_fit(self):
        done = subprocess.run(
            ["/usr/bin/mypy", "--config-file", os.path.join(PACKAGE, "pyproject.toml"),
             "--python-executable", sys.executable, "--cache-dir", os.path.join(BUILT, ".mypy"),
             "-p", "sheaf", "-p", "sheaf_autoscaler",
             *(part for path in sorted(glob.glob(PACKAGE + "/examples/*.py"))
                              for part in ("-m", os.path.basename(path)[:-3]))],
            cwd=BUILT, env=dict(os.environ, MYPYPATH=f"{BUILT}:{PACKAGE}/examples"),
            capture_output=True, text=True, timeout=120 * farms.PATIENCE)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertTrue(os.path.exists(os.path.join(BUILT, "sheaf", "py.typed")))

    def test_every_call_of_the_service_is_used_or_left_to_the_program(self):
        from sheaf.v1 import job_pb2
        calls = {m.name for m in job_pb2.DESCRIPTOR.services_by_name["JobService"].methods}
        with open(os.path.join(BUILT, "sheaf", "client.py"), encoding="utf-8") as file:
            text = file.read()
        unused = {call for call in calls if f'"{call}"' not in text and f".{call}(" not in text}
        self.assertEqual(unused, {"CreateJob", "CollectGarbage", "SetShare", "ResetShare",
                                  "ListUsage", "ReadTaskBundle"})

    def test_states_are_those_of_the_messages(self):
        from sheaf.v1 import farm_pb2, frame_pb2, job_view_pb2
        for kind, numbers in ((sheaf.JobState, job_view_pb2.Job.State),
                              (sheaf.WorkerState, farm_pb2.Worker.State),
                              (sheaf.StopReason, frame_pb2.StopReason)):
            names = {re.sub("^(STOP_REASON|STATE)_", "", n): v for n, v in numbers.items()}
            names.pop("UNSPECIFIED", None)
            self.assertEqual({e.name: e.value for e in kind if e.name != "UNKNOWN"}, names)

    def test_addresses(self):
        from sheaf.address import coordinator_addresses, parse_address
        for text, complete, loopback in (
                ("farm", "farm:7400", False), ("farm:1", "farm:1", False),
                ("localhost", "localhost:7400", True), ("127.9.0.1:80", "127.9.0.1:80", True),
                ("[::1]", "[::1]:7400", True), ("[fe80::1]:9", "[fe80::1]:9", False)):
            self.assertEqual((str(parse_address(text)), parse_address(text).is_loopback),
                             (complete, loopback))
        for text in ("", "::1", "farm:", "farm:0", "farm:65536", "farm:x", "[::1", "a b:7:8"):
            with self.assertRaisesRegex(sheaf.InvalidRequestError, "write for example"):
                parse_address(text)
        with mock.patch.dict(os.environ, SHEAF_COORDINATOR="node:5"):
            self.assertEqual(str(coordinator_addresses(None)), "node:5")
        several = coordinator_addresses("localhost,127.0.0.2:7401")
        self.assertEqual(str(several), "localhost:7400,127.0.0.2:7401")
        self.assertTrue(several.is_loopback)
        self.assertFalse(coordinator_addresses("localhost,10.0.0.1").is_loopback)
        for text, target in (
                ("farm", "farm:7400"), ("localhost,127.0.0.2:7401",
                                        "ipv4:127.0.0.1:7400,127.0.0.2:7401"),
                ("[::1],10.0.0.2", "ipv6:[::1]:7400,[::ffff:10.0.0.2]:7400"),
                ("nowhere.invalid,127.0.0.1:1", "ipv4:127.0.0.1:1")):
            self.assertEqual(coordinator_addresses(text).target(), target)
        for text in ("a,,b", "a,", ",".join("abcdefghi")):
            with self.assertRaises(sheaf.InvalidRequestError):
                coordinator_addresses(text)

    def test_nobody_answers(self):
        with mock.patch("sheaf.connection.FIRST_ANSWER_SECONDS", 0.2):
            with sheaf.connect(f"127.0.0.1:{farms.free_port()}") as client:
                with self.assertRaisesRegex(sheaf.UnreachableError,
                                            "no coordinator answers at .*start one"):
                    client.list_jobs()
        with self.assertRaisesRegex(sheaf.InvalidRequestError, "closed"):
            client.list_jobs()

    def test_no_plain_text_to_other_machines(self):
        with tempfile.TemporaryDirectory() as home, mock.patch.dict(os.environ,
                                                                    XDG_CONFIG_HOME=home):
            with self.assertRaisesRegex(sheaf.NotLoggedInError, "sheaf login farm.example:7400"):
                sheaf.connect("farm.example")
            with self.assertLogs("sheaf", "WARNING"), mock.patch("sheaf.credentials._speaks_tls",
                                                                 return_value=False):
                sheaf.connect("farm.example", insecure=True).close()

    def test_a_failed_job_is_an_exception(self):
        from sheaf.jobs import job_from
        from sheaf.v1 import job_view_pb2
        failed = job_from(job_view_pb2.Job(name="jobs/3", state=job_view_pb2.Job.STATE_FAILED,
                                      failure="room.pbrt:3:1: too large"))
        client = sheaf.Client(mock.Mock())
        with mock.patch.object(client, "watch", return_value=(job for job in [failed])):
            with self.assertRaisesRegex(sheaf.JobFailedError, "room.pbrt:3:1: too large") as raised:
                client.wait(3)
        self.assertIs(raised.exception.job, failed)

    def test_watches_get_the_frames_that_have_changed(self):
        from sheaf.job_changes import JobChanges
        from sheaf.v1 import frame_pb2, job_view_pb2

        def message(numbers, troubles, digest, changes=True):
            job = job_view_pb2.Job(name="jobs/3", waiting_reason=digest, frames_are_changes=changes)
            for number in numbers:
                job.frames.append(frame_pb2.Frame(
                    spec=frame_pb2.FrameSpec(frame_number=number), image_digest=digest))
            for number in troubles:
                job.troubles.append(
                    job_view_pb2.FrameTrouble(frame_number=number, incomplete=digest))
            return job

        def state(job):
            whole = job.message
            self.assertFalse(whole.frames_are_changes)
            self.assertEqual([(f.number, f.image_digest) for f in job.frames],
                             [(f.spec.frame_number, f.image_digest) for f in whole.frames])
            return (job.waiting_reason, [f.image_digest for f in job.frames],
                    [(t.frame_number, t.incomplete) for t in whole.troubles])

        known = JobChanges()
        first = known.add(message([1, 2, 30], [1, 30], "a", changes=False))
        second = known.add(message([2, 30], [2], "b"))
        self.assertEqual(state(second), ("b", ["a", "b", "b"], [(1, "a"), (2, "b")]))
        self.assertEqual(state(first), ("a", ["a"] * 3, [(1, "a"), (30, "a")]))
        self.assertIs(second.frames[0], first.frames[0])
        self.assertEqual(state(known.add(message([], [], "c")))[1], ["a", "b", "b"])
        self.assertEqual(state(known.add(message([7], [], "d", changes=False))), ("d", ["d"], []))

        # WatchJob sends these between the first message and the last one.
        stub = mock.Mock()
        stub.WatchJob.return_value = mock.MagicMock(__next__=mock.Mock(side_effect=[
            message([1, 2], [], "a", changes=False), message([2], [], "b"),
            job_view_pb2.Job(name="jobs/3", state=job_view_pb2.Job.STATE_SUCCEEDED)]))
        client = sheaf.Client(mock.Mock(call=lambda attempt, *_: attempt(stub)))
        jobs = list(client.watch(3))
        self.assertTrue(stub.WatchJob.call_args[0][0].changes_only)
        self.assertEqual([[f.image_digest for f in job.frames] for job in jobs],
                         [["a", "a"], ["a", "b"], []])

    def test_values_of_a_newer_coordinator(self):
        from sheaf.jobs import job_from
        from sheaf.v1 import job_view_pb2
        self.assertIs(job_from(job_view_pb2.Job(state=77)).state, sheaf.JobState.UNKNOWN)

    def test_versions_of_the_protocol(self):
        from sheaf import protocol
        said = farms.local("--version")
        self.assertIn(f"protocol {protocol.PROTOCOL_VERSION}, understands "
                      f"{protocol.OLDEST_PROTOCOL_VERSION} to {protocol.PROTOCOL_VERSION}", said)
        for text in ("", "0-1", "1-1", "1-7", "1-999999"):
            protocol.check_answer(protocol.parse_range(text))
        for text in ("1", "2-1", "-1-1", "a-b", "0-1 ", "0-1000000"):
            with self.assertRaisesRegex(sheaf.WrongStateError, "does not say which versions"):
                protocol.parse_range(text)
        with self.assertRaisesRegex(sheaf.WrongStateError, "this package is older"):
            protocol.check_answer((2, 3))
        with mock.patch.multiple(protocol, OLDEST_PROTOCOL_VERSION=2, PROTOCOL_VERSION=3):
            with self.assertRaisesRegex(sheaf.WrongStateError, "coordinator version 1: the coor"):
                protocol.check_answer((1, 1))

    def test_refusals_that_pass_are_told_from_others(self):
        from sheaf.connection import transient_wait
        refusal = mock.Mock()
        refusal.code.return_value = grpc.StatusCode.RESOURCE_EXHAUSTED
        for text, wait in (("too many calls; retry after 0.5 s", 0.5), ("the disk is full", None),
                           ("too many; retry after 99999 s", None)):
            refusal.details.return_value = text
            self.assertEqual(transient_wait(refusal), wait)


class FarmTest(unittest.TestCase):
    """One farm, made by the package, serves all tests."""

    @classmethod
    def setUpClass(cls):
        cls.farm = sheaf.Farm(threads=1, programs=farms.programs())
        cls.enterClassContext(cls.farm)
        cls.client = cls.farm.client
        cls.folder = tempfile.mkdtemp(prefix="sheaf scenes ")
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        cls.scene = write_scene(cls.folder, "scene.pbrt")

    def example(self, name, *arguments):
        environment = dict(os.environ, PYTHONPATH=BUILT, SHEAF_COORDINATOR=self.farm.address,
                           PATH=os.pathsep.join((farms.programs(), self.folder,
                                                 os.environ["PATH"])))
        done = subprocess.run([sys.executable, os.path.join(PACKAGE, "examples", name), *arguments],
                              env=environment, cwd=self.folder, stdin=subprocess.DEVNULL,
                              capture_output=True, text=True, timeout=WAIT_SECONDS)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        return done.stdout

    def endless_job(self):
        job = self.client.submit(self.scene, samples=MANY, priority=-5)
        self.addCleanup(self.client.cancel, job)
        return job

    def test_an_image_by_layers(self):
        job = self.client.submit(self.scene, samples=FEW, title="a title",
                                 options=("--aov", "position", "--crop", "8,4,40,20"))
        self.assertEqual((job.title, job.frames[0].width_px), ("a title", 48))
        job = self.client.wait(job, WAIT_SECONDS)
        self.assertIs(job.state, sheaf.JobState.SUCCEEDED)
        self.assertIs(job.frames[0].stop_reason, sheaf.StopReason.SAMPLES)
        self.assertEqual(job.progress.fraction, 1)
        self.assertLess(job.create_time, job.end_time)
        image = self.client.image(job, 1)
        self.assertEqual((image.rgb.shape, image.window), ((16, 32, 3), (8, 4, 40, 20)))
        self.assertTrue((image.samples == FEW).all())
        self.assertEqual(image.metadata["imageDigest"], job.frames[0].image_digest)
        self.assertAlmostEqual(image.relative_mse, job.progress.relative_mse, delta=1e-8)
        self.assertEqual(image.error_curve[-1].samples_per_pixel, FEW)
        # The square has z = 0 and covers the crop's middle; rows run downwards, so y falls.
        position = image.layer("P")
        self.assertLess(numpy.abs(position[..., 2]).max(), 1e-3)
        self.assertTrue((numpy.diff(position[:, 6:-6, 1], axis=0) < 0).all())
        with self.assertRaisesRegex(sheaf.NotFoundError, "it has .*albedo"):
            image.layer("depht")

    def test_frames_by_number(self):
        for number in (1, 2):
            write_scene(self.folder, f"shot.{number:04}.pbrt")
        job = self.client.submit(os.path.join(self.folder, "shot.####.pbrt"), frames="1-2",
                                 samples=1)
        job = self.client.wait(job, WAIT_SECONDS)
        self.assertEqual([frame.number for frame in job.frames], [1, 2])
        self.assertEqual(self.client.image(job, 2).metadata["frameNumber"], "2")
        with self.assertRaisesRegex(sheaf.InvalidRequestError, "has 2 frames; .*1, 2"):
            self.client.image(job)
        with self.assertRaisesRegex(sheaf.NotFoundError, "no frame 3; it has 1, 2"):
            self.client.image(job, 3)

    def test_the_numbers_are_those_of_the_program(self):
        path = os.path.join(self.folder, "numbers.exr")
        job = self.client.wait(self.client.submit(self.scene, samples=FEW), WAIT_SECONDS)
        self.client.download(job, path)
        compared = farms.json.loads(farms.compare(path, path))
        image = sheaf.read_image(path)
        self.assertAlmostEqual(float(image.rgb.mean(dtype=float)), compared["image_mean"], 7)
        self.assertTrue((image.rgb[0, 0, 0] < image.rgb[0, 0, 1] < image.rgb[0, 0, 2]))  # The sky.
        expected = 2 * (image.error.astype(float) ** 2).mean()
        self.assertAlmostEqual(compared["expected_relative_mse"], expected / compared["image_mean"]
                               ** 2, delta=0.5 * compared["expected_relative_mse"])
        self.assertEqual([f for f in os.listdir(self.folder) if "partial" in f], [])

    def test_errors_fall_and_jobs_are_refined(self):
        with self.assertRaisesRegex(sheaf.InvalidRequestError, "needs a limit"):
            self.client.refine(1)
        job = self.client.wait(self.client.submit(self.scene, samples=FEW), WAIT_SECONDS)
        first = job.progress.relative_mse
        job = self.client.wait(self.client.refine(job, samples=4 * FEW), WAIT_SECONDS)
        self.assertLess(job.progress.relative_mse, first)
        first = job.progress.relative_mse
        price, = self.client.price_refinement(job, [first / 2])
        self.assertLessEqual(price.cpu_seconds.low, price.cpu_seconds.high)
        job = self.client.refine(job, target_error=first / 2, time_seconds=3600)
        states = list(self.client.watch(job, WAIT_SECONDS))
        self.assertIs(states[-1].state, sheaf.JobState.SUCCEEDED)
        frame = states[-1].frames[0]
        self.assertIs(frame.stop_reason, sheaf.StopReason.TARGET_ERROR)
        self.assertLessEqual(frame.rounds[-1].relative_mse_upper, first / 2)

    def test_jobs_are_controlled(self):
        job = self.endless_job()
        self.assertEqual(job.priority, -5)
        self.assertEqual(self.client.set_priority(job, 7).priority, 7)
        self.assertTrue(self.client.pin(job).message.pinned)
        self.assertFalse(self.client.unpin(job).message.pinned)
        self.assertIs(self.client.pause(job.name).state, sheaf.JobState.PAUSED)
        with self.assertRaisesRegex(sheaf.WaitExpiredError, "continues"):
            self.client.wait(job, timeout_seconds=0.3)
        self.assertIsNot(self.client.resume(int(job.name[5:])).state, sheaf.JobState.PAUSED)
        self.assertIn(job.name, [j.name for j in self.client.list_jobs(1000)])
        self.assertEqual(len(self.client.list_jobs(1)), 1)
        with self.assertRaises(sheaf.WrongStateError):
            self.client.image(job)
        frame = self.client.get_job(job).frames[0].number
        self.assertEqual(self.client.kill(job, frame).message.incomplete_frame_count, 1)
        self.assertEqual(self.client.retry(job, frame=frame).message.incomplete_frame_count, 0)
        self.client.cancel(job)
        with self.assertRaises(sheaf.JobCancelledError) as raised:
            self.client.wait(job, WAIT_SECONDS)
        self.assertIs(raised.exception.job.state, sheaf.JobState.CANCELLED)
        with self.assertRaises(sheaf.WrongStateError):
            self.client.pause(job)

    def test_errors_have_types_and_words(self):
        wrong = write_scene(self.folder, "wrong.pbrt", 'Foo "bar"\n')
        with self.assertRaisesRegex(sheaf.SceneError, r"wrong\.pbrt:\d+:1: .*Foo"):
            self.client.submit(wrong)
        with self.assertRaisesRegex(sheaf.InvalidRequestError, "--samples"):
            self.client.submit(self.scene, samples=-1)
        with self.assertRaises(sheaf.SheafError):
            self.client.submit(os.path.join(self.folder, "missing.pbrt"))
        with self.assertRaisesRegex(sheaf.NotFoundError, "999"):
            self.client.get_job(999)
        with self.assertRaises(sheaf.NotFoundError):
            next(self.client.watch("jobs/999"))
        with self.assertRaisesRegex(sheaf.InvalidRequestError, "1001"):
            self.client.set_priority(1, 1001)
        with self.assertRaisesRegex(sheaf.FileError, "undamaged EXR"):
            sheaf.read_image(wrong)
        with self.assertRaisesRegex(sheaf.ProgramError, "add that folder to PATH"):
            sheaf.Farm(programs=self.folder).__enter__()

    def test_a_package_of_another_version_is_refused_in_words(self):
        from sheaf import protocol
        with mock.patch.multiple(protocol, OLDEST_PROTOCOL_VERSION=700, PROTOCOL_VERSION=701):
            with sheaf.connect(self.client.address) as other:
                words = "speaks versions 700 to 701 .*: the coordinator's program is older"
                with self.assertRaisesRegex(sheaf.WrongStateError, words):
                    other.list_jobs()
                with self.assertRaisesRegex(sheaf.WrongStateError, words):
                    next(other.watch("jobs/1"))

    def test_workers(self):
        worker, = self.client.list_workers()
        self.assertIn(worker.state, (sheaf.WorkerState.IDLE, sheaf.WorkerState.BUSY))
        self.assertEqual(worker.thread_count, 1)
        self.client.lift_quarantine(worker.identity)
        self.assertIn("http", self.farm.page)
        self.assertNotEqual(self.farm.log("coordinator"), "")

    def test_examples(self):
        first, second = (os.path.join(self.folder, name) for name in ("a.exr", "b.exr"))
        self.assertIn("48 x 32", self.example("submit_and_wait.py", self.scene, first))
        farms.render(self.scene, second, "--samples", 64, "--seed", 3)
        compared = self.example("compare_images.py", first, second)
        self.assertGreater(float(re.search(r"([\d.]+)% of the values", compared)[1]), 97)
        errors = self.example("watch_error.py", self.scene, "0.0005")
        self.assertRegex(errors, r"(?s)at most .*succeeded")
        denoiser, third = (os.path.join(self.folder, name) for name in ("oidnDenoise", "c.exr"))
        with open(denoiser, "w", encoding="utf-8") as file:  # Leaves the noise in.
            file.write('#!/bin/sh\n[ "$3$5$7" = --hdr--alb--nrm ] && [ -s "$8" ] && cp "$4" "$2"\n')
        os.chmod(denoiser, 0o700)
        self.example("denoise_with_oidn.py", first, third)
        self.assertTrue((sheaf.read_image(third).rgb == sheaf.read_image(first).rgb).all())


class OtherFarmsTest(unittest.TestCase):
    def test_a_watch_outlives_the_coordinator(self):
        with farms.Farm() as farm, tempfile.TemporaryDirectory() as folder:
            with sheaf.connect(farm.address, programs=farms.programs()) as client:
                job = client.submit(write_scene(folder, "scene.pbrt"), samples=FEW)
                changes = client.watch(job, WAIT_SECONDS)
                self.assertIs(next(changes).state, sheaf.JobState.QUEUED)
                farm.kill(farm.coordinator)
                farm.start_coordinator()
                farm.start_worker()
                self.assertIs(list(changes)[-1].state, sheaf.JobState.SUCCEEDED)

    def test_the_autoscaler_starts_workers_and_drains_them(self):
        """Also over its own death: it has no state. It and its workers know another coordinator,
        which stands by.
        """
        def start():
            command = [sys.executable, "-m", "sheaf_autoscaler", "--engine", "local",
                       "--coordinator", both, "--threads", "1", "--max", "2",
                       "--cool-down", "2s", "--queue-time", "1s", "--look-every", "0.3s",
                       "--worker", os.path.join(farms.programs(), "sheaf-worker"),
                       "--cache-dir", farm.path("cache"), "--log-file", farm.path("workers.log")]
            with open(farm.path("autoscaler.log"), "ab") as log:
                return subprocess.Popen(command, env=dict(os.environ, PYTHONPATH=BUILT),
                                        stdin=subprocess.DEVNULL, stdout=log, stderr=log)

        def running():
            return [w for w in client.list_workers() if any(
                tag.startswith("instance.local.") for tag in w.message.tags)
                and w.state in (sheaf.WorkerState.IDLE, sheaf.WorkerState.BUSY)]
        with farms.Farm() as farm, tempfile.TemporaryDirectory() as folder:
            both = f"127.0.0.1:{farms.free_port()},{farm.address}"
            with sheaf.connect(both, programs=farms.programs()) as client:
                autoscaler = start()
                try:
                    client.wait(client.submit(write_scene(folder, "a.pbrt"), samples=4 * FEW),
                                WAIT_SECONDS)
                    autoscaler.kill()
                    autoscaler.wait()
                    self.assertTrue(running(), "they outlive it")
                    autoscaler = start()
                    farms.wait_until(lambda: not running(), 30, "no workers after the cool-down")
                    client.wait(client.submit(write_scene(folder, "b.pbrt"), samples=FEW),
                                WAIT_SECONDS)
                    farms.wait_until(lambda: not running(), 30, "no workers again")
                finally:
                    autoscaler.terminate()
                    autoscaler.wait()
                    for worker in running():  # Where the test has failed.
                        client.drain([worker.name], then_exit=True)
            self.assertEqual(farm.metrics()["sheaf_workers_lost_total"], 0)

    def test_a_farm_with_certificates(self):
        with SecureFarm() as farm:
            def home(name):
                return mock.patch.dict(os.environ, XDG_CONFIG_HOME=farm.path("home-" + name))
            farm.log_in("anna", "submit")
            farm.log_in("otto", "view")
            with home("nobody"), self.assertRaisesRegex(sheaf.NotLoggedInError, "speaks TLS"):
                sheaf.connect(farm.address)
            # The first of two coordinators that share the farm stands by.
            both = f"{farm.address.partition(':')[0]}:{farms.free_port()},{farm.address}"
            with home("anna"), sheaf.connect(both, programs=farms.programs()) as client:
                job = client.submit(farm.scene, samples=FEW)
                self.assertEqual(job.owner, "anna")
            with home("otto"), sheaf.connect(farm.address, programs=farms.programs()) as client:
                self.assertEqual(client.get_job(job).name, job.name)
                with self.assertRaises(sheaf.NotPermittedError):
                    client.cancel(job)
                farm.administer("revoke", "user", "otto")
                with self.assertRaises(sheaf.NotLoggedInError):
                    client.list_jobs()

    def test_old_certificates_are_renewed_by_the_program(self):
        with tempfile.TemporaryDirectory() as folder:
            home = os.path.join(folder, "sheaf", "coordinators", "0123")
            os.makedirs(home)
            for name, text in (("addresses", "farm.example:7400\n"), ("key.pem", "k"),
                               ("certificate.pem", "old"), ("authority.pem", "a")):
                with open(os.path.join(home, name), "w", encoding="utf-8") as file:
                    file.write(text)
            certificate = os.path.join(home, "certificate.pem")
            program = os.path.join(folder, "sheaf-programs", "sheaf")
            os.makedirs(os.path.dirname(program))
            with open(program, "w", encoding="utf-8") as file:
                file.write(f'#!/bin/sh\nprintf "new $*" > "{certificate}"\n')
            os.chmod(program, stat.S_IRWXU)
            with mock.patch.dict(os.environ, XDG_CONFIG_HOME=folder):
                used = []
                with mock.patch("sheaf.connection.open_channel",
                                side_effect=lambda *arguments: used.append(arguments[1])
                                or mock.Mock()):
                    for days in (3, 4):
                        then = farms.time.time() - 86400 * days
                        os.utime(certificate, (then, then))
                        sheaf.connect("farm.example", programs=os.path.dirname(program)).close()
            self.assertEqual([c.certificate.split()[0] for c in used], [b"old", b"new"])
            self.assertIn(b"workers --coordinator farm.example:7400", used[1].certificate)


if __name__ == "__main__":
    unittest.main(verbosity=2)
