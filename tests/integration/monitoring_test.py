#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""deploy/monitoring against a real farm with certificates and a real Prometheus on loopback.

Needs the programs promtool and prometheus: deploy/install-packages test unpacks them.
"""
import json
import os
import re
import shutil
import subprocess
import unittest
from urllib.parse import urlencode
from urllib.request import urlopen

from farm import PATIENCE, ROOT, Farm, free_port, wait_until
from secure_farm_test import MANY, Browser, SecureFarm

MONITORING = os.path.join(ROOT, "deploy", "monitoring")
SCRAPE_SECONDS_MAX = 60

# Metrics that a farm does not have from its start, with the reason.
METRICS_OF_LIVE_JOBS = {  # One sample for each live job or its user; there is none of no job.
    "sheaf_user_jobs", "sheaf_user_samples", "sheaf_user_cpu_seconds",
    "sheaf_job_samples", "sheaf_job_cpu_seconds", "sheaf_job_part_bytes",
    "sheaf_job_relative_mse", "sheaf_job_relative_mse_predicted", "sheaf_job_prediction_ratio"}
METRICS_OF_CERTIFICATES = {  # A farm without certificates refuses no identity and has none to end.
    "sheaf_refused_total", "sheaf_calls_refused_total", "sheaf_certificate_expiry_time_seconds"}


def program(name):
    unpacked = os.path.join(ROOT, "build", "programs", "usr", "bin", name)
    found = shutil.which(name) or (unpacked if os.path.exists(unpacked) else None)
    if found is None:
        raise AssertionError(f"{name} is missing: run deploy/install-packages test")
    return found


def read(*names):
    with open(os.path.join(ROOT, *names), encoding="utf-8") as file:
        return file.read()


def promtool(*arguments, text=None):
    done = subprocess.run([program("promtool"), *arguments], capture_output=True, text=True,
                          input=text, cwd=MONITORING, timeout=120 * PATIENCE)
    if done.returncode != 0:
        raise AssertionError(f"promtool {' '.join(arguments)}\n{done.stdout}{done.stderr}")
    return done.stdout


def dashboard_queries():
    """The queries of all panels, with Grafana's variables replaced."""
    panels = json.loads(read("deploy", "monitoring", "sheaf.dashboard.json"))["panels"]
    return [target["expr"].replace("$__rate_interval", "1m").replace("$instance", ".*")
            for panel in panels for target in panel.get("targets", [])]


def metric_names(text):
    """Names as of TYPE lines: a histogram's series are of one name."""
    return {re.sub("_seconds_(bucket|sum|count)$", "_seconds", name)
            for name in re.findall(r"\bsheaf_[a-z0-9_]+", text)}


class Prometheus:
    """A server that scrapes a farm by the configuration of deploy/monitoring; use with `with`."""

    def __init__(self, farm):
        self.address = f"127.0.0.1:{free_port()}"
        self.folder = farm.path("prometheus")
        os.makedirs(self.folder)
        token, authority = (os.path.join(self.folder, name) for name in ("token", "authority.pem"))
        with open(token, "w", encoding="utf-8") as file:
            file.write(farm.administer("scraper", "prometheus").stdout)
        shutil.copy(farm.path("state", "access", "authority.pem"), authority)
        config = read("deploy", "monitoring", "prometheus.yml")
        for before, after in {
                "/etc/prometheus/sheaf.token": token,
                "/etc/prometheus/sheaf-authority.pem": authority,
                '"farm.example.org:7480"': json.dumps(farm.http),
                "  - sheaf.rules.yml": "  - " + os.path.join(MONITORING, "sheaf.rules.yml"),
                "scrape_interval: 15s": "scrape_interval: 1s",
                "evaluation_interval: 15s": "evaluation_interval: 1s"}.items():
            assert config.count(before) == 1, before
            config = config.replace(before, after)
        self.config = os.path.join(self.folder, "prometheus.yml")
        with open(self.config, "w", encoding="utf-8") as file:
            file.write(config)

    def __enter__(self):
        with open(os.path.join(self.folder, "log"), "wb") as log:
            self.process = subprocess.Popen(
                [program("prometheus"), "--config.file", self.config, "--storage.tsdb.path",
                 os.path.join(self.folder, "data"), "--web.listen-address", self.address],
                stdin=subprocess.DEVNULL, stdout=log, stderr=log)
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()

    def get(self, path, **parameters):
        """The data of an answer of the HTTP API; None if there is no answer."""
        if self.process.poll() is not None:
            with open(os.path.join(self.folder, "log"), encoding="utf-8") as log:
                raise AssertionError("prometheus ended:\n" + log.read())
        try:
            with urlopen(f"http://{self.address}/api/v1/{path}?{urlencode(parameters)}",
                         timeout=30 * PATIENCE) as answer:
                return json.load(answer)["data"]
        except OSError:
            return None

    def query(self, expression):
        """The samples of a query; AssertionError if it is refused."""
        data = self.get("query", query=expression)
        if data is None:
            raise AssertionError("Prometheus refuses " + expression)
        return data["result"]


class MonitoringTest(unittest.TestCase):
    def test_each_alert_fires_and_does_not(self):
        promtool("check", "rules", "sheaf.rules.yml")
        promtool("test", "rules", "sheaf.rules.test.yml")
        promtool("check", "config", "--syntax-only", "prometheus.yml")
        alerts = re.findall(r"^      - alert: (\w+)$",
                            read("deploy", "monitoring", "sheaf.rules.yml"), re.M)
        cases = re.findall(r"^    name: (\w+)$",
                           read("deploy", "monitoring", "sheaf.rules.test.yml"), re.M)
        self.assertEqual(alerts, cases)

    def test_prometheus_watches_a_farm(self):
        with SecureFarm() as farm:
            farm.log_in("anna", "submit")
            token = farm.administer("scraper", "reader").stdout.strip()

            def exposition():
                return Browser(farm).send("GET", "/metrics",
                                          headers={"Authorization": "Bearer " + token}).text

            def names():
                return metric_names("\n".join(re.findall(r"^# TYPE (\S+)", exposition(), re.M)))

            idle = names()
            farm.enrol_worker("node7")
            farm.person("anna", "submit", farm.scene, *MANY)
            wait_until(lambda: METRICS_OF_LIVE_JOBS <= names(), 30, "metrics of the job")
            self.assertEqual(names() - idle, METRICS_OF_LIVE_JOBS)
            promtool("check", "metrics", text=exposition())
            with Farm() as plain:
                shown = [name.partition("{")[0] for name in plain.metrics()]
                self.assertEqual(idle - metric_names("\n".join(shown)),
                                 METRICS_OF_CERTIFICATES)
            with Prometheus(farm) as prometheus:
                self.watch(farm, prometheus, names())

    def watch(self, farm, prometheus, exposed):
        def is_up():
            up = prometheus.get("query", query='up{job="sheaf"}')
            return up and up["result"] and up["result"][0]["value"][1] == "1"
        wait_until(is_up, SCRAPE_SECONDS_MAX, "the first scrape")
        self.assertEqual(prometheus.query("up")[0]["metric"]["instance"], farm.http)

        def evaluated():
            groups = prometheus.get("rules")["groups"]
            rules = [rule for group in groups for rule in group["rules"]]
            return rules and all(rule["health"] != "unknown" for rule in rules) and rules
        rules = wait_until(evaluated, SCRAPE_SECONDS_MAX, "the first evaluation of all rules")
        self.assertEqual([rule["name"] for rule in rules if rule["health"] != "ok"], [])
        self.check_runbooks(rules)
        queries = dashboard_queries()
        for query in queries:
            prometheus.query(query)
        used = "\n".join(queries + [rule["query"] for rule in rules])
        self.assertEqual(metric_names(used) - exposed, set())
        # Selectors of labels too: what they select exists.
        for selector in set(re.findall(r"sheaf_\w+\{[^}]*\}", used)):
            self.assertTrue(prometheus.query(selector), selector)
        live = prometheus.query('sum(sheaf_workers{state=~"idle|busy"})')
        self.assertEqual([sample["value"][1] for sample in live], ["1"])
        job = prometheus.query("sheaf_job_samples")[0]["metric"]
        self.assertEqual(job["exported_job"], "jobs/1", "as the dashboard names it")
        self.assertEqual([rule["name"] for rule in rules if rule["state"] == "firing"], [])

    def check_runbooks(self, rules):
        headings = re.findall(r"^### (\w+)$", read("docs", "operations.md"), re.M)
        for rule in rules:
            annotations = rule["annotations"]
            self.assertTrue(annotations["summary"] and annotations["description"], rule["name"])
            self.assertEqual(annotations["runbook"],
                             "docs/operations.md#" + rule["name"].lower())
            self.assertIn(rule["labels"]["severity"], ("warning", "critical"))
        self.assertEqual(sorted(headings), sorted(rule["name"] for rule in rules))


if __name__ == "__main__":
    unittest.main(verbosity=2)
