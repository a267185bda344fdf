# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Stands in for sbatch, squeue and scancel: each takes its options and its variables from the
environment as the manuals say, and the site (a JSON file, SLURM_STAND_IN) adds what plug-ins and
wrappers do. Nothing runs: tests set the states of tasks.
"""
import fcntl
import json
import os
import re
import stat
import sys

PROGRAMS = ("sbatch", "squeue", "scancel")
SHORT = {"-M": "--clusters", "-J": "--job-name", "-a": "--array", "-p": "--partition"}


class Site:
    """A folder with the programs. settings: "rename" (a plug-in names all jobs so), "forward" (a
    plug-in submits to that cluster), "hide" (squeue shows nothing), "noise" (lines before and after
    those of squeue), "words" (what sbatch prints before its answer), "answer" (instead of it),
    "short" (squeue joins the tasks of an array), "fail" (programs that end with an error).
    """

    def __init__(self, folder, **settings):
        self._folder = folder
        for program in PROGRAMS:
            path = os.path.join(folder, program)
            with open(path, "w", encoding="utf-8") as file:
                file.write(f"#!/bin/sh\nexec {sys.executable} -S {os.path.abspath(__file__)} "
                           f'{program} "$@"\n')
            os.chmod(path, stat.S_IRWXU)
        self.path = os.path.join(folder, "site.json")
        self.write({"settings": settings, "next": 7, "tasks": []})

    def environment(self, **more):
        return dict(os.environ, SLURM_STAND_IN=self.path,
                    PATH=f"{self._folder}:{os.environ['PATH']}", **more)

    def read(self):
        with open(self.path, encoding="utf-8") as file:
            return json.load(file)

    def write(self, state):
        with open(self.path, "w", encoding="utf-8") as file:
            json.dump(state, file)

    def set(self, **settings):
        state = self.read()
        state["settings"] = settings
        self.write(state)

    def live(self):
        """Tasks that wait or run, of all clusters."""
        return [task for task in self.read()["tasks"]
                if task["state"] not in ("CANCELLED", "FAILED")]

    def end(self, purge=False):
        """All tasks fail; slurmctld may forget them at once."""
        state = self.read()
        for task in state["tasks"]:
            task["state"] = "FAILED"
        if purge:
            state["tasks"] = []
        self.write(state)


def options_of(words):
    options, rest = {}, []
    words = list(words)
    while words:
        word = words.pop(0)
        name, equal, value = word.partition("=")
        if word[:2] in SHORT:
            name, value = SHORT[word[:2]], word[2:] or words.pop(0)
        elif not word.startswith("-"):
            rest.append(word)
            continue
        elif not equal and name in SHORT.values():
            value = words.pop(0)
        options[name] = value
    return options, rest


def sbatch(state, options, _):
    settings = state["settings"]
    cluster = (options.get("--clusters") or os.environ.get("SLURM_CLUSTERS")
               or os.environ.get("SBATCH_CLUSTERS") or "")
    cluster = settings.get("forward", cluster)
    first, last = map(int, options["--array"].split("-"))
    job, state["next"] = state["next"], state["next"] + 1
    for task in range(first, last + 1):
        state["tasks"].append({
            "cluster": cluster or "home", "job": job, "task": task, "state": "PENDING",
            "name": settings.get("rename", options["--job-name"]),
            "partition": options.get("--partition", "usual")})
    print(settings.get("words", ""), end="")
    print(settings.get("answer", f"{job};{cluster}" if cluster else f"{job}"))


def squeue(state, options, _):
    settings, env = state["settings"], os.environ
    if settings.get("hide"):
        return
    clusters = options.get("--clusters") or env.get("SLURM_CLUSTERS") or ""
    print(settings.get("noise", ""), end="")
    if clusters:
        print(f"CLUSTER: {clusters}")
    tasks = [task for task in state["tasks"] if task["cluster"] == (clusters or "home")]
    if "--jobs" in options:
        tasks = [task for task in tasks if str(task["job"]) == options["--jobs"]]
        if not tasks:
            sys.exit("slurm_load_jobs error: Invalid job id specified")
    for option, variable, key in (("--name", "SQUEUE_NAMES", "name"),
                                  ("--partition", "SQUEUE_PARTITION", "partition")):
        chosen = options.get(option) or env.get(variable)
        tasks = [task for task in tasks if not chosen or task[key] in chosen.split(",")]
    shown = options.get("--states") or env.get("SQUEUE_STATES") or "PENDING,RUNNING"
    tasks = [task for task in tasks if shown == "all" or task["state"] in shown.split(",")]
    if env.get("SQUEUE_FORMAT2"):
        sys.exit("squeue: error: -o and -O are incompatible")
    lines = [(f"{t['job']}_{t['task']}", t) for t in tasks]
    if settings.get("short"):
        jobs = {t["job"]: t for t in tasks}
        lines = [("%d_[%s%%4]" % (job, ",".join(str(t["task"]) for t in tasks
                                                if t["job"] == job)), t)
                 for job, t in jobs.items()]
    for identifier, task in lines:
        values = {"i": identifier, "T": task["state"], "M": "0:00", "N": "", "j": task["name"],
                  "r": "Priority"}
        print(re.sub("%(.)", lambda match: values[match[1]], options["--format"]))
    print(settings.get("noise", ""), end="")


def scancel(state, options, tasks):
    clusters = options.get("--clusters") or os.environ.get("SLURM_CLUSTERS") or "home"
    if os.environ.get("SCANCEL_INTERACTIVE"):
        sys.exit("scancel: error: no answer to the prompt")
    chosen = os.environ.get("SCANCEL_STATE")
    for task in state["tasks"]:
        if (f"{task['job']}_{task['task']}" in tasks and task["cluster"] == clusters
                and chosen in (None, task["state"])):
            task["state"] = "CANCELLED"


def main():
    program, *words = sys.argv[1:]
    with open(os.environ["SLURM_STAND_IN"], "r+", encoding="utf-8") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        state = json.load(file)
        if program in state["settings"].get("fail", ()):
            sys.exit(f"{program}: error: Unable to contact slurm controller")
        {"sbatch": sbatch, "squeue": squeue, "scancel": scancel}[program](
            state, *options_of(words))
        file.seek(0)
        file.truncate()
        json.dump(state, file)


if __name__ == "__main__":
    main()
