#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The image, run by podman: what its account may do, its health checks, how it confines scenes, and
the pod of the worker from the manifests, which renders and is stopped as Kubernetes would stop it.

    kubernetes_test.py MANIFESTS      from `run`, which builds the image and the manifests
"""
import json
import os
import re
import subprocess
import sys
import tempfile
import time
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(os.path.dirname(os.path.dirname(HERE)), "integration"))

import farm as farms  # noqa: E402
from client_case import SCENE  # noqa: E402

IMAGE = "localhost/sheaf:latest"
PODMAN = ["podman", "--cgroup-manager=cgroupfs", "--events-backend=file", "--runtime=runc"]
# As the manifests confine containers.
CONFINED = ["--read-only", "--tmpfs", "/tmp", "--cap-drop", "ALL", "--security-opt",
            "no-new-privileges", "--network", "host", "-v", "/var/lib/sheaf", "-v",
            "/var/cache/sheaf"]
MANIFESTS = None  # Their path.


def podman(*arguments, check=True, seconds=120, text=None):
    done = subprocess.run([*PODMAN, *map(str, arguments)], input=text, capture_output=True,
                          text=True, timeout=seconds, check=False)
    if check and done.returncode:
        raise AssertionError(f"podman {' '.join(map(str, arguments))}: {done.returncode}\n"
                             f"{done.stdout}{done.stderr}")
    return done


class Container:
    """Use with `with`: a container in the background, with volumes of its own."""

    def __init__(self, name, *options_and_command):
        self.name, self._arguments = name, options_and_command

    def __enter__(self):
        podman("rm", "-f", "-i", self.name)
        podman("run", "-d", "--name", self.name, *self._arguments)
        return self

    def __exit__(self, *_):
        podman("rm", "-f", "-t", "1", "-v", self.name, check=False)

    def log(self):
        done = podman("logs", self.name)
        return done.stdout + done.stderr

    def health(self):
        done = podman("exec", self.name, "sheaf-health", check=False)
        return done.returncode, done.stdout.strip()


class ImageTest(unittest.TestCase):
    def run_in(self, *arguments, **options):
        return podman("run", "--rm", *CONFINED, IMAGE, *arguments, **options)

    def test_account_and_root(self):
        self.assertIn("uid=10001(sheaf)", self.run_in("id").stdout)
        self.assertNotEqual(self.run_in("touch", "/usr/x", check=False).returncode, 0)
        self.assertNotEqual(self.run_in("gcc", "--version", check=False).returncode, 0)
        for program in ("sheaf", "sheaf-worker", "sheaf-coordinator"):
            self.assertIn("0.", self.run_in(program, "--version").stdout)

    def test_textures_are_read(self):
        """The library of images is loaded with the first texture."""
        scene = SCENE.replace("Shape", 'Texture "t" "spectrum" "imagemap" "string filename" '
                              '"t.tga"\nMaterial "diffuse" "texture reflectance" "t"\nShape')
        with tempfile.TemporaryDirectory() as folder:
            os.chmod(folder, 0o777)
            with open(os.path.join(folder, "s.pbrt"), "w", encoding="utf-8") as file:
                file.write(scene)
            with open(os.path.join(folder, "t.tga"), "wb") as file:  # 1 x 1, 24 bits.
                file.write(bytes([0, 0, 2, *[0] * 9, 1, 0, 1, 0, 24, 32, 9, 99, 199]))
            podman("run", "--rm", *CONFINED, "-v", f"{folder}:/scene", IMAGE, "sheaf", "render",
                   "/scene/s.pbrt", "--samples", 16, "-o", "/scene/o.exr")
            self.assertTrue(os.path.exists(os.path.join(folder, "o.exr")))

    def test_coordinator_and_its_health(self):
        with Container("sheaf-test-c", *CONFINED, "-e", "SHEAF_HEALTH_GRPC=17400", "-e",
                       "SHEAF_HEALTH_HTTP=17480", IMAGE, "sheaf-coordinator", "--listen",
                       "127.0.0.1:17400", "--http", "127.0.0.1:17480", "--state-dir",
                       "/var/lib/sheaf") as container:
            farms.wait_until(lambda: container.health()[0] == 0, 60, container.log())
            self.assertEqual(container.health(), (0, "answers"))
            podman("kill", "--signal", "STOP", container.name)
            process = podman("inspect", "--format", "{{.State.Pid}}", container.name).stdout.strip()
            farms.wait_until(lambda: read_state(process) == "T", 10, "a process that stands still")
            self.assertEqual(container.health()[0], 1)
            podman("kill", "--signal", "CONT", container.name)
            farms.wait_until(lambda: container.health()[0] == 0, 20, "a process that continues")

    def test_certificates(self):
        with Container("sheaf-test-t", *CONFINED, "-e", "SHEAF_HEALTH_GRPC=17401", "-e",
                       "SHEAF_HEALTH_HTTP=17481", IMAGE, "sh", "-c",
                       "sheaf-coordinator init --name localhost --state-dir /var/lib/sheaf && exec "
                       "sheaf-coordinator --listen 127.0.0.1:17401 --http 127.0.0.1:17481 "
                       "--state-dir /var/lib/sheaf") as container:
            farms.wait_until(lambda: container.health()[0] == 0, 60, container.log())
            self.assertEqual(container.health(), (0, "takes connections"))


def read_state(process):
    with open(f"/proc/{process}/stat", encoding="utf-8") as file:
        return file.read().rpartition(")")[2].split()[0]


class WorkerTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.farm = farms.Farm(["--lease-seconds", "10"])
        cls.farm.__enter__()
        cls.addClassCleanup(cls.farm.__exit__)
        cls.scene = cls.farm.path("scene.pbrt")
        with open(cls.scene, "w", encoding="utf-8") as file:
            file.write(SCENE)

    def worker(self, name, *options, sandbox="best"):
        return Container(name, *CONFINED, *options, IMAGE, "sheaf-worker", "--coordinator",
                         self.farm.address, "--threads", 1, "--no-peers", f"--sandbox={sandbox}")

    def told(self, container, words):
        farms.wait_until(lambda: words in container.log(), 60, f"{words!r} in the log")

    def test_sandbox(self):
        """With podman's own filter, with none, and with one that forbids namespaces, as containerd
        and Docker have it.
        """
        strict = "seccomp=" + os.path.join(HERE, "no-namespaces.json")
        every = "protections: namespaces, file access rules, system call filter"
        for options in ((), ("--security-opt", "seccomp=unconfined")):
            with self.worker("sheaf-test-w", *options, sandbox="required") as container:
                self.told(container, every)
        with self.worker("sheaf-test-w", "--security-opt", strict) as container:
            self.told(container, every.replace("namespaces, ", "") + "; no namespaces")
            self.assertEqual(container.health(), (0, "sheaf-worker runs"))
            self.check_job(16)
        with self.worker("sheaf-test-w", "--security-opt", strict, sandbox="required") as container:
            self.told(container, "cannot be confined as --sandbox=required asks: no namespaces")

    def submit(self, samples):
        return self.farm.sheaf("submit", self.scene, "--samples", samples, "--pass-samples", 64,
                               "--lease-passes", 1).stdout.strip()

    def job(self, name):
        return json.loads(self.farm.sheaf("show", name, "--json").stdout)

    def ended(self, name):
        def state():
            time.sleep(0.2)
            job = self.job(name)
            return job if job["state"] in ("succeeded", "failed") else None
        return farms.wait_until(state, 240, f"the end of {name}")

    def check_job(self, samples):
        """A job has the image of `sheaf render`."""
        job = self.ended(self.submit(samples))
        self.assertEqual(job["state"], "succeeded", job)
        path = self.farm.path("direct.exr")
        farms.render(self.scene, path, "--samples", samples)
        shown = json.loads(self.farm.sheaf("show", path, "--json").stdout)
        self.assertEqual(shown["image_digest"], job["frames"][0]["image_digest"])

    def manifest(self):
        """The worker's Deployment, for a podman on this machine."""
        with open(MANIFESTS, encoding="utf-8") as file:
            documents = file.read().split("\n---\n")
        text, = (d for d in documents if "\nkind: Deployment\n" in d)
        for old, new in (("--coordinator=sheaf-coordinator:7400",
                          f"--coordinator={self.farm.address}"),
                         ("--threads=4", "--threads=1"), ("--peer-port=7401", "--peer-port=0"),
                         ("registry.example.org/sheaf:latest", IMAGE),
                         ('cpu: "4"', 'cpu: "1"'),
                         ("        ports:\n        - containerPort: 7401\n          name: peers\n",
                          ""), ("    spec:\n      automount",
                                                    "    spec:\n      hostNetwork: true\n"
                                                    "      automount")):
            self.assertIn(old, text)
            text = text.replace(old, new)
        return text

    def test_pod(self):
        """The pod of the manifests renders; preStop hands its work back; another pod continues
        it."""
        text = self.manifest()
        hook = re.search(r"- (kill -TERM 1; while .*)$", text, re.M)[1]
        path = self.farm.path("pod.yaml")
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)
        self.addCleanup(podman, "kube", "down", path, check=False)
        podman("kube", "play", path)
        self.check_job(1024)
        name, = podman("ps", "--filter", "name=worker", "--format", "{{.Names}}").stdout.split()
        self.assertEqual(podman("exec", name, "id", "-u").stdout.strip(), "10001")
        job = self.submit(1 << 15)
        farms.wait_until(lambda: self.job(job)["progress"]["sample_count_done"] > 0, 60, "a result")
        begin = time.monotonic()
        podman("exec", name, "/bin/sh", "-c", hook, check=False)
        stopped = time.monotonic() - begin
        lost = self.farm.metrics()["sheaf_workers_lost_total"]
        workers = json.loads("[" + ",".join(
            self.farm.sheaf("workers", "--json").stdout.splitlines()) + "]")
        self.assertEqual(lost, 0)
        self.assertNotIn("lost", [worker["state"] for worker in workers])
        podman("kube", "down", path)
        self.farm.start_worker()
        self.assertEqual(self.ended(job)["state"], "succeeded")
        print(f"preStop took {stopped:.1f} s")


if __name__ == "__main__":
    MANIFESTS = sys.argv.pop()
    unittest.main(verbosity=2)
