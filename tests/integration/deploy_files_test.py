#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The units of deploy/systemd, the templates of deploy/openjd and deploy/opencue, and the manifests
of deploy/kubernetes.

They call the programs with options that exist; the templates have the fields that OpenJD
(specification 2023-09) and OpenCue (job specification cjsl-1.14) require. Neither farm manager is
run here. Schemas of the manifests: tests/engines/kubernetes.
"""
import glob
import json
import os
import re
import shutil
import subprocess
import tempfile
import unittest
import xml.etree.ElementTree as xml

from farm import ROOT, programs

DEPLOY = os.path.join(ROOT, "deploy")


def read(*names):
    with open(os.path.join(DEPLOY, *names), encoding="utf-8") as file:
        return file.read()


def refused_options(command):
    """The options of a command line that its program's --help does not list."""
    help_text = subprocess.run([os.path.join(programs(), os.path.basename(command[0])), "--help"],
                               capture_output=True, text=True, check=True, timeout=600).stdout
    known = set(re.findall(r"^  (?:-\w, )?(--[a-z-]+)", help_text, re.M))
    return {word.partition("=")[0] for word in command if word.startswith("--")} - known


class DeployFilesTest(unittest.TestCase):
    def test_scripts_say_how_they_are_called(self):
        for name in ("deploy/build", "deploy/demo", "deploy/install-packages",
                     "deploy/packages/build", "deploy/packages/chroot", "deploy/image/build",
                     "tests/run"):
            done = subprocess.run([os.path.join(ROOT, name), "--help"], capture_output=True,
                                  text=True, timeout=600)
            self.assertEqual((done.returncode, done.stderr), (0, ""), name)
            self.assertRegex(done.stdout, rf"(?m)^  +{name}( |$)")
            self.assertNotIn("pipefail", done.stdout)

    def test_unknown_purposes_of_packages_are_refused(self):
        done = subprocess.run([os.path.join(DEPLOY, "install-packages"), "biuld"],
                              capture_output=True, text=True, timeout=600)
        self.assertEqual((done.returncode, done.stdout), (1, ""))
        self.assertIn("biuld: deploy/packages.txt has no packages of this purpose", done.stderr)

    def test_units_call_programs_as_they_are(self):
        units = sorted(glob.glob(os.path.join(DEPLOY, "systemd", "*.service")))
        self.assertEqual(len(units), 3)
        for path in units:
            with open(path, encoding="utf-8") as file:
                text = file.read()
            command, = re.findall(r"^ExecStart=(.*)$", text, re.M)
            self.assertEqual(refused_options(command.split()), set(), path)
            user, = re.findall(r"^User=(.*)$", text, re.M)
            program = os.path.basename(command.split()[0])
            self.assertRegex(read("systemd", program + ".sysusers.conf"), rf"(?m)^u {user} ")
            self.assertRegex(text, r"(?m)^Type=notify$[^[]*^WatchdogSec=")
            if "sheaf-worker" in path:  # It makes namespaces and mounts of its own.
                self.assertNotRegex(text, r"(?m)^(RestrictNamespaces|SystemCallFilter|ProcSubset)=")

    def test_both_worker_units_are_confined_alike(self):
        one, several = (read("systemd", name).partition("[Service]")[2]
                        for name in ("sheaf-worker.service", "sheaf-worker@.service"))
        self.assertEqual(several.replace("EnvironmentFile=-/etc/sheaf/worker-%i.conf\n", ""), one)

    @unittest.skipUnless(shutil.which("systemd-analyze"), "systemd is not installed")
    def test_systemd_knows_every_setting(self):
        with tempfile.TemporaryDirectory() as folder:
            for unit in glob.glob(os.path.join(DEPLOY, "systemd", "*.service")):
                path = os.path.join(folder, os.path.basename(unit).replace("@.", "@0."))
                with open(unit, encoding="utf-8") as file:
                    text = file.read().replace("/usr/local/bin", programs())
                with open(path, "w", encoding="utf-8") as file:
                    file.write(text)
                done = subprocess.run(["systemd-analyze", "verify", "--man=no", path],
                                      capture_output=True, text=True, timeout=600, check=False)
                told = [line for line in done.stderr.splitlines() if path in line
                        or os.path.basename(path) in line]
                self.assertEqual((done.returncode, told), (0, []), unit)

    def test_openjd_template(self):
        template = json.loads(read("openjd", "sheaf-workers.json"))
        self.assertEqual(template["specificationVersion"], "jobtemplate-2023-09")
        self.assertLessEqual(len(template["name"]), 128)
        parameters = {parameter["name"] for parameter in template["parameterDefinitions"]}
        step, = template["steps"]
        self.assertEqual(set(re.findall(r"\{\{Param\.(\w+)\}\}", json.dumps(template))),
                         parameters)
        for parameter in template["parameterDefinitions"]:
            self.assertIn(parameter["type"], ("STRING", "INT"))
        worker, = step["parameterSpace"]["taskParameterDefinitions"]
        self.assertEqual((worker["type"], worker["range"]), ("INT", "1-{{Param.WorkerCount}}"))
        run = step["script"]["actions"]["onRun"]
        self.assertEqual(refused_options([run["command"], *run["args"]]), set())
        grace = int(run["args"][run["args"].index("--grace-seconds") + 1])
        self.assertGreater(run["cancelation"]["notifyPeriodInSeconds"], grace)

    def test_opencue_template(self):
        spec = xml.fromstring(read("opencue", "sheaf-workers.xml"))
        self.assertEqual([child.tag for child in spec],
                         ["facility", "show", "shot", "user", "uid", "job"])
        job = spec.find("job")
        self.assertTrue(job.get("name"))
        layer, = job.find("layers")
        self.assertEqual(layer.get("type"), "Render")
        order = ["cmd", "range", "chunk", "cores", "threadable", "memory", "services"]
        self.assertEqual([child.tag for child in layer], order)
        self.assertEqual(refused_options(layer.find("cmd").text.split()), set())

    def test_kubernetes_manifests(self):
        arguments = {}
        for program in ("worker", "coordinator"):
            text = read("kubernetes", "base", program + ".yaml")
            text = text[text.index(f'command: ["sheaf-{program}"]'):]
            arguments[program] = re.findall(r"^            - (--\S+)$", text, re.M)
            self.assertGreater(len(arguments[program]), 3)
            self.assertEqual(refused_options(["sheaf-" + program, *arguments[program]]), set())
        grace, = (a for a in arguments["worker"] if a.startswith("--grace-seconds="))
        notice = re.search(r"terminationGracePeriodSeconds: (\d+)",
                           read("kubernetes", "base", "worker.yaml"))
        self.assertGreater(int(notice[1]), int(grace.partition("=")[2]))
        patched = 0
        for path in glob.glob(os.path.join(DEPLOY, "kubernetes", "overlays", "*", "kust*.yaml")):
            with open(path, encoding="utf-8") as file:
                text = file.read()
            # Patches name arguments by their place: that of the same option.
            replaced = re.findall(r"containers/0/args/(\d+)\n +value: (--[a-z-]+)=", text)
            for place, option in replaced:
                self.assertEqual(arguments["worker"][int(place)].partition("=")[0], option, path)
                patched += 1
            for option in re.findall(r"containers/0/args/-\n +value: (--[a-z-]+)", text):
                known = [p for p in arguments if not refused_options(["sheaf-" + p, option])]
                self.assertNotEqual(known, [], path)
        self.assertEqual(patched, 2)
        metrics = set(re.findall(r"query: sum\((\w+)", read("kubernetes", "overlays", "production",
                                                           "scaling.yaml")))
        self.assertEqual(metrics, {"sheaf_work_left_cpu_seconds", "sheaf_workers"})

    def test_image_has_run_time_packages_and_programs(self):
        text = read("image", "Containerfile")
        self.assertIn("\nUSER 10001:10001\n", text)
        self.assertIn("\nHEALTHCHECK ", text)
        packages = re.findall(r"^run (\S+)$", read("packages.txt"), re.M)
        self.assertGreater(len(packages), 10)
        self.assertFalse([p for p in packages if p.endswith("-dev")])


if __name__ == "__main__":
    unittest.main(verbosity=2)
