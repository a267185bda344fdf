#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""A farm with certificates, from init to revocation, of real processes on loopback."""
import glob
import http.client
import json
import os
import ssl
import stat
import subprocess
import unittest

import farm as farms
from client_case import SCENE
from farm import Farm, programs, wait_until

FEW, MANY = ("--samples", 4), ("--samples", 1 << 20)


class TwoMachines:
    """Two network namespaces with a link between them."""
    COORDINATOR, WORKER = "10.213.7.1", "10.213.7.2"

    def __init__(self):
        self.names = [f"sheaf-{os.getpid()}-{side}" for side in "ab"]

    def __enter__(self):
        first, second = self.names
        try:
            for name in self.names:
                self.run("netns", "add", name)
            self.run("-n", first, "link", "add", "veth0", "type", "veth", "peer", "name", "veth0",
                     "netns", second)
            for name, address in zip(self.names, (self.COORDINATOR, self.WORKER)):
                self.run("-n", name, "address", "add", address + "/24", "dev", "veth0")
                self.run("-n", name, "link", "set", "veth0", "up")
                self.run("-n", name, "link", "set", "lo", "up")
        except (OSError, subprocess.CalledProcessError) as error:
            self.__exit__()
            raise unittest.SkipTest("no network namespaces here") from error
        return self

    def __exit__(self, *_):
        for name in self.names:
            if os.path.exists("/run/netns/" + name):
                self.run("netns", "delete", name)

    @staticmethod
    def run(*arguments):
        subprocess.run(["ip", *arguments], check=True, capture_output=True, timeout=60)


class SecureFarm(Farm):
    """A farm after init; each user has a home of their own."""

    def __init__(self, machines=None):
        super().__init__()
        self.environment["XDG_CONFIG_HOME"] = self.path("admin")
        if machines:
            here, there = (["ip", "netns", "exec", name] for name in machines.names)
            self.coordinator_prefix, self.client_prefix = here, there
            self.host = machines.COORDINATOR
            self.address = self.http = self.host + ":0"
        self.administer("init", "--name", self.host)
        self.scene = self.path("scene.pbrt")
        with open(self.scene, "w", encoding="utf-8") as file:
            file.write(SCENE)

    def administer(self, command, *arguments, check=True):
        return subprocess.run(
            [os.path.join(programs(), "sheaf-coordinator"), command, *arguments, "--state-dir",
             self.path("state")], env=self.environment, capture_output=True, text=True,
            check=check, timeout=60)

    def token(self, *arguments):
        path = self.path("token-" + "-".join(arguments[:2]))
        with open(path, "w", encoding="utf-8") as file:
            file.write(self.administer("enroll", *arguments).stdout)
        return path

    def person(self, name, *arguments, check=True):
        """Runs sheaf as the user of this name, with a home of their own."""
        before = dict(self.environment)
        self.environment["XDG_CONFIG_HOME"] = self.path("home-" + name)
        try:
            return self.sheaf(*arguments, check=check)
        finally:
            self.environment = before

    def log_in(self, name, role):
        return self.person(name, "login", self.address, "--token-file",
                           self.token("user", name, "--role", role))

    def enrol_worker(self, name):
        return self.start_worker("--token", self.token("worker", name), "--identity-dir",
                                 self.path("identity-" + name))

    def audit(self):
        with open(self.path("state", "audit.log"), encoding="utf-8") as file:
            return [json.loads(line) for line in file]


class Browser:
    """Requests to the page over HTTPS, which trust the farm's authority only."""

    def __init__(self, farm):
        host, self.port = farm.http.rsplit(":", 1)
        authority, = glob.glob(farm.path("admin", "sheaf", "coordinators", "*", "authority.pem"))
        self.host = host
        self.context = ssl.create_default_context(cafile=authority)
        self.cookie = ""

    def send(self, method, path, body=None, headers=()):
        connection = http.client.HTTPSConnection(self.host, self.port, context=self.context,
                                                 timeout=30)
        try:
            connection.request(method, path, body, {"Cookie": self.cookie, **dict(headers)})
            response = connection.getresponse()
            response.text = response.read().decode(errors="replace")
            return response
        finally:
            connection.close()

    def sign_in(self, token):
        response = self.send("POST", "/login", "token=" + token,
                             {"Content-Type": "application/x-www-form-urlencoded"})
        self.cookie = response.getheader("Set-Cookie", "").split(";")[0]
        return response


class SecureFarmTest(unittest.TestCase):
    def test_a_farm_of_certified_machines_and_people(self):
        with SecureFarm() as farm:
            farm.enrol_worker("node7")
            self.assertIn("with the role submit", farm.log_in("anna", "submit").stdout)
            image = farm.path("image.exr")
            job = farm.person("anna", "submit", farm.scene, *FEW, "--wait", "-o", image, "--json")
            self.assertEqual(json.loads(job.stdout.splitlines()[-1])["owner"], "anna")
            alone = farm.path("alone.exr")
            farms.render(farm.scene, alone, *FEW)
            self.assertEqual(farms.image_digest(image), farms.image_digest(alone))
            self.assertIn("anna", farm.person("anna", "list").stdout)
            self.refuse_others(farm)
            self.revoke(farm)
            self.check_files(farm)

    def refuse_others(self, farm):
        job = farm.person("anna", "submit", farm.scene, *MANY).stdout.strip()
        farm.log_in("vera", "view")
        farm.log_in("ben", "submit")
        farm.log_in("olga", "operate")
        refused = farm.person("vera", "submit", farm.scene, *FEW, check=False)
        self.assertIn("user:vera has the role view", refused.stderr)
        refused = farm.person("ben", "cancel", job, check=False)
        self.assertIn("the job belongs to anna", refused.stderr)
        bundle = ("bundle", job + ":1:0", "-o", farm.path("task.tar"))
        refused = farm.person("ben", *bundle, check=False)
        self.assertIn("the job belongs to anna", refused.stderr)
        farm.person("anna", *bundle)
        farm.person("olga", *bundle)
        refused = farm.person("nobody", "list", check=False)
        self.assertIn(f"the coordinator speaks TLS, and no certificate for {farm.address} is "
                      f"stored here; run sheaf login {farm.address}", refused.stderr)
        farm.person("olga", "pause", job)
        farm.person("anna", "cancel", job)
        again = farm.person("thief", "login", farm.address, "--token-file",
                            farm.path("token-user-anna"), check=False)
        self.assertIn("the enrolment token is unknown, used, expired or revoked", again.stderr)

    def revoke(self, farm):
        farm.administer("revoke", "user", "anna")
        refused = farm.person("anna", "list", check=False)
        self.assertIn("user:anna is revoked", refused.stderr)
        farm.administer("revoke", "worker", "node7")
        wait_until(lambda: "worker:node7 is revoked" in farm.log("worker1"), 30,
                   "the worker's message")
        self.assertIn("worker:node7", farm.administer("identities").stdout)
        self.assertNotEqual(
            farm.administer("revoke", "user", "nobody", check=False).returncode, 0)
        lines = farm.audit()

        def noted(who, what, outcome):
            return any(line["who"].startswith(who) and line["what"] == what
                       and line["outcome"].startswith(outcome) for line in lines)
        self.assertTrue(noted("user:anna", "CreateJob", "ok"))
        self.assertTrue(noted("user:vera", "FindMissing", "PERMISSION_DENIED")
                        or noted("user:vera", "CreateJob", "PERMISSION_DENIED"))
        self.assertTrue(noted("user:ben", "CancelJob", "PERMISSION_DENIED"))
        self.assertTrue(noted("uid", "revoke", "ok"))
        self.assertTrue(noted("uid", "revoke", "NOT_FOUND"))
        self.assertTrue(noted("ipv4:127.0.0.1", "Enroll", "UNAUTHENTICATED"))

    def check_files(self, farm):
        for folder in ("state/access", "admin/sheaf/coordinators", "home-anna/sheaf/coordinators",
                       "identity-node7"):
            for parent, _, files in os.walk(farm.path(folder)):
                self.assertEqual(stat.S_IMODE(os.stat(parent).st_mode), 0o700, parent)
                for name in files:
                    path = os.path.join(parent, name)
                    if not name.startswith("access.db"):
                        self.assertEqual(stat.S_IMODE(os.stat(path).st_mode), 0o600, path)

    def test_a_worker_keeps_its_certificate_over_restarts(self):
        with SecureFarm() as farm:
            farm.log_in("anna", "submit")
            worker = farm.enrol_worker("node7")
            wait_until(lambda: "enrolled as worker:node7" in farm.log("worker1"), 30, "enrolment")
            farm.kill(worker)
            os.remove(farm.path("token-worker-node7"))
            farm.kill(farm.coordinator)
            farm.start_coordinator()
            farm.start_worker("--identity-dir", farm.path("identity-node7"))
            farm.person("anna", "submit", farm.scene, *FEW, "--wait", "-o", farm.path("image.exr"))

    def test_the_page_over_https(self):
        with SecureFarm() as farm:
            farm.log_in("anna", "submit")
            farm.log_in("ben", "submit")
            job = farm.person("anna", "submit", farm.scene, *MANY).stdout.strip()
            browser = Browser(farm)
            self.assertEqual(browser.send("GET", "/healthz").status, 200)
            self.assertEqual(browser.send("GET", "/api/v1/jobs").status, 401)
            self.assertEqual(browser.send("GET", "/").getheader("Location"), "/login")
            self.assertIn('action="/login"', browser.send("GET", "/login").text)
            address, token = farm.person("anna", "page").stdout.split()
            self.assertEqual(address, f"https://{farm.http}/login")
            self.assertEqual(browser.sign_in(token).getheader("Location"), "/")
            self.assertIn("<title>Sheaf</title>", browser.send("GET", "/").text)
            jobs = json.loads(browser.send("GET", "/api/v1/jobs").text)["jobs"]
            self.assertEqual([listed["owner"] for listed in jobs], ["anna"])
            self.assertEqual(Browser(farm).sign_in(token).getheader("Location"), "/login#refused")
            self.control_jobs_by_page(farm, browser, f"/api/v1/{job}:cancel")

    def control_jobs_by_page(self, farm, anna, cancel):
        ben = Browser(farm)
        ben.sign_in(farm.person("ben", "page").stdout.split()[1])
        changes = {"X-Sheaf-Request": "1"}
        self.assertEqual(ben.send("POST", cancel, headers=changes).status, 403)
        self.assertEqual(anna.send("POST", cancel).status, 403, "without the header")
        self.assertEqual(anna.send("POST", cancel, headers=changes).status, 200)
        farm.administer("revoke", "user", "anna")
        self.assertEqual(anna.send("GET", "/api/v1/jobs").status, 401)
        self.assertEqual(ben.send("POST", "/logout", headers=changes).status, 303)
        self.assertEqual(ben.send("GET", "/api/v1/jobs").status, 401)

    def test_a_scrape_token_reads_metrics_until_it_is_revoked(self):
        with SecureFarm() as farm:
            scraper = Browser(farm)
            token = farm.administer("scraper", "prometheus").stdout.strip()
            shown = {"Authorization": "Bearer " + token}
            self.assertEqual(scraper.send("GET", "/metrics").status, 401)
            answer = scraper.send("GET", "/metrics", headers=shown)
            self.assertEqual(answer.status, 200)
            self.assertIn('sheaf_refused_total{limit="calls"} 0\n', answer.text)
            self.assertEqual(scraper.send("GET", "/api/v1/jobs", headers=shown).status, 403)
            self.assertIn("user:prometheus", farm.administer("identities").stdout)
            farm.administer("revoke", "user", "prometheus")
            self.assertEqual(scraper.send("GET", "/metrics", headers=shown).status, 401)

    def test_without_a_certificate_no_worker_works(self):
        with SecureFarm() as farm:
            farm.start_worker("--identity-dir", farm.path("identity-none"))
            farm.log_in("anna", "view")
            wait_until(lambda: "the coordinator speaks TLS" in farm.log("worker1"), 30,
                       "the worker's message")
            self.assertEqual(farm.person("anna", "workers", "--json").stdout, "")

    def test_a_farm_of_two_machines(self):
        """Two network namespaces stand for the machines; needs root."""
        with TwoMachines() as machines, SecureFarm(machines) as farm:
            refused = farm.person("nobody", "list", check=False)
            self.assertIn("no certificate for the coordinator at", refused.stderr)
            self.assertIn("--insecure", refused.stderr)
            refused = farm.person("nobody", "list", "--insecure", check=False)
            self.assertIn("the coordinator speaks TLS", refused.stderr)
            farm.log_in("anna", "submit")
            farm.enrol_worker("node7")
            image, alone = farm.path("image.exr"), farm.path("alone.exr")
            farm.person("anna", "submit", farm.scene, *FEW, "--wait", "-o", image)
            farms.render(farm.scene, alone, *FEW)
            self.assertEqual(farms.image_digest(image), farms.image_digest(alone))

    def test_no_certificates_no_other_addresses(self):
        with Farm() as farm:
            done = subprocess.run(
                [os.path.join(programs(), "sheaf-coordinator"), "--listen", "0.0.0.0:0", "--http",
                 "", "--state-dir", farm.path("other")], capture_output=True, text=True,
                check=False, timeout=60)
            self.assertEqual(done.returncode, 1)
            self.assertIn("run sheaf-coordinator init", done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
