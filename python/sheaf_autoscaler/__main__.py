# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The program sheaf-autoscaler."""
from __future__ import annotations

import argparse
import hashlib
import logging
import os
import re
import signal
import sys
import threading
from typing import Callable

from .controller import Bounds, Controller, FarmError, Step
from .engine import INSTANCE_PREFIX, Engine, EngineError
from .local import LocalEngine
from .output import run_program
from .slurm import SlurmEngine, SlurmOptions

LOG = logging.getLogger("sheaf-autoscaler")
# Without a controller, the workers of a pool that may be empty end after this many cool-downs.
ORPHAN_COOL_DOWNS = 4
WORKERS_LIMIT = 10_000
SECONDS_MIN = 0.1
NAME = re.compile(r"[A-Za-z0-9._@-]{1,32}")
UNITS = {"s": 1, "m": 60, "h": 3600, "d": 86400}


def duration(text: str) -> float:
    """Seconds of "90s", "10m", "1h30m" or "45"."""
    if re.fullmatch(r"\d+(\.\d+)?", text):
        return float(text)
    parts = re.findall(r"(\d+(?:\.\d+)?)([smhd])", text)
    if not parts or "".join(n + u for n, u in parts) != text:
        raise argparse.ArgumentTypeError(f'"{text}": write for example 90s, 10m or 1h30m')
    return sum(float(number) * UNITS[unit] for number, unit in parts)


def some_time(text: str) -> float:
    """A duration that divides, or is slept for."""
    seconds = duration(text)
    if seconds < SECONDS_MIN:
        raise argparse.ArgumentTypeError(f'"{text}": is less than {SECONDS_MIN} s; give more')
    return seconds


def name(text: str) -> str:
    if not NAME.fullmatch(text):
        raise argparse.ArgumentTypeError(f'"{text}": 1 to 32 letters, digits, ".", "-", "_", "@"')
    return text


def whole(low: int, high: int) -> Callable[[str], int]:
    def number(text: str) -> int:
        if not re.fullmatch(r"\d{1,9}", text) or not low <= int(text) <= high:
            raise argparse.ArgumentTypeError(f'"{text}": give a number from {low} to {high}')
        return int(text)
    return number


def parser() -> argparse.ArgumentParser:
    made = argparse.ArgumentParser(
        prog="sheaf-autoscaler",
        description="Keeps as many workers of a coordinator as its jobs need (docs/elastic.md). "
        "May be stopped and started at any time.",
        epilog="Example: sheaf-autoscaler --engine slurm --coordinator farm.example.org:7400 "
        "--threads 16 --max 20 --slurm-partition render --slurm-qos low")
    add = made.add_argument
    add("--engine", choices=("slurm", "local"), required=True, help="what starts workers")
    add("--coordinator", help="HOST:PORT (default 127.0.0.1:7400; also from SHEAF_COORDINATOR); "
        "of several that share a farm: all, separated by commas")
    add("--insecure", action="store_true", help="for experiments: without encryption")
    add("--pool", type=name, default="default", help="pool of the workers (default: %(default)s)")
    add("--tag", type=name, action="append", default=[],
        help="a property of the workers that jobs may require; may be given several times")
    add("--min", type=whole(0, WORKERS_LIMIT), default=0, help="workers at least (default: 0)")
    add("--max", type=whole(1, WORKERS_LIMIT), default=8, help="workers at most (default: 8)")
    add("--threads", type=whole(1, 4096), required=True, help="threads of each worker")
    add("--scene-memory-max", type=whole(1, 1 << 20), metavar="GIB",
        help="of each worker, in GiB; jobs that require more are left to others")
    add("--cool-down", type=duration, default=300.0, metavar="TIME",
        help="a worker that was not needed for this long ends (default: 5m)")
    add("--queue-time", type=some_time, default=600.0, metavar="TIME",
        help="target time of work without a deadline (default: 10m)")
    add("--start-time", type=duration, default=30.0, metavar="TIME",
        help="from the request for a worker to its first lease (default: 30s)")
    add("--look-every", type=some_time, default=5.0, metavar="TIME", help="default: 5s")
    add("--worker", default="sheaf-worker", metavar="PATH", help="the program of workers")
    add("--worker-option", action="append", default=[], metavar="OPTION",
        help="passed on to workers, as --worker-option=--sandbox=required")
    add("--cache-dir", metavar="DIR", help="of workers, on a disk of the machine that they run on")
    add("--grace-seconds", type=whole(0, 86400), default=20,
        help="time of a worker to finish its tasks after SIGTERM (default: 20)")
    add("--log-file", default="sheaf-workers.log", help="local: the log of the workers")
    add("--once", action="store_true", help="look and act once, then end")
    slurm = made.add_argument_group("Slurm, as sbatch means them")
    for option in ("partition", "account", "qos", "constraint"):
        slurm.add_argument("--slurm-" + option, default="")
    slurm.add_argument("--slurm-memory", default="", help="sbatch --mem")
    slurm.add_argument("--slurm-output", default="/dev/null", help="log of the workers")
    slurm.add_argument("--slurm-exclusive", action="store_true",
                       help="one worker a node; otherwise one for each set of --threads processors")
    slurm.add_argument("--slurm-option", action="append", default=[], metavar="OPTION",
                       help="passed on to sbatch")
    return made


def worker_command(options: argparse.Namespace, coordinator: str) -> list[str]:
    command = [options.worker, "--coordinator", coordinator, "--threads", str(options.threads),
               "--pool", options.pool, "--grace-seconds", str(options.grace_seconds)]
    if options.insecure:
        command.append("--insecure")
    if options.cache_dir:
        command += ["--cache-dir", options.cache_dir]
    if options.scene_memory_max:
        command += ["--scene-memory-max", f"{options.scene_memory_max}G"]
    if options.min == 0:
        idle = max(1, round(ORPHAN_COOL_DOWNS * options.cool_down))
        command += ["--exit-when-idle-seconds", str(idle)]
    for tag in options.tag:
        command += ["--tag", tag]
    return command + options.worker_option


def make_engine(options: argparse.Namespace, coordinator: str) -> Engine:
    command = worker_command(options, coordinator)
    # Pools of several coordinators may share a user.
    key = f"{options.pool}-{hashlib.sha256(coordinator.encode()).hexdigest()[:8]}"
    if options.engine == "local":
        return LocalEngine(key, command, options.log_file)
    return SlurmEngine(SlurmOptions(
        f"sheaf-{key}", options.slurm_partition, options.slurm_account, options.slurm_qos,
        options.slurm_constraint, options.slurm_exclusive, options.threads, options.slurm_memory,
        options.slurm_output, max(60, options.grace_seconds + 10), tuple(options.slurm_option)),
        command)


def told(step: Step) -> str:
    parts = [f"{step.count} workers, wanted {step.target}"]
    for count, what in ((step.grown, "asked for {} more"), (step.kept, "kept {} that were leaving"),
                        (len(step.drained), "draining {}"), (len(step.ended), "ended {}")):
        if count:
            parts.append(what.format(count))
    if step.wanted.at_risk:
        parts.append("deadlines at risk: " + ", ".join(step.wanted.at_risk))
    return "; ".join(parts)


def run(controller: Controller, options: argparse.Namespace) -> int:
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        # Ignored ones stay so: a script's command in the background ignores SIGINT.
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, lambda *_: stop.set())
    last, failed = "", ""
    while True:
        try:
            text = told(controller.step())
            if failed:
                LOG.info("works again")
            if text != last:
                LOG.info("%s", text)
            last, failed = text, ""
        except (FarmError, EngineError) as error:
            if str(error) != failed:
                LOG.warning("%s", error)
            failed = str(error) or type(error).__name__
        except Exception as error:
            # A pool whose autoscaler has ended neither grows nor shrinks.
            text = f"{type(error).__name__}: {error}"
            if text != failed:
                LOG.exception("a defect of sheaf-autoscaler; it tries again. Please report it")
            failed = text
        if options.once or stop.wait(options.look_every):
            return 1 if options.once and failed else 0


def operate() -> int:
    options = parser().parse_args()
    logging.basicConfig(level=logging.INFO, stream=sys.stderr,
                        format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    if options.min > options.max:
        parser().error(f"--min {options.min} is more than --max {options.max}")
    import sheaf  # Only here: the rest works without gRPC.
    from .coordinator import CoordinatorReader
    try:
        client = sheaf.connect(options.coordinator, insecure=options.insecure,
                               answer_seconds=options.look_every)
        memory = (options.scene_memory_max or 0) << 30
        reader = CoordinatorReader(client, options.pool, options.tag, memory)
        engine = make_engine(options, client.address)
    except (sheaf.SheafError, EngineError) as error:
        LOG.error("%s", error)
        return 1
    bounds = Bounds(options.min, options.max, options.threads, options.cool_down,
                    options.queue_time, options.start_time)
    with client:
        prefix = f"{INSTANCE_PREFIX}{options.engine}."
        return run(Controller(reader, engine, bounds, prefix), options)


def main() -> int:
    return run_program("sheaf-autoscaler", operate)


if __name__ == "__main__":
    sys.exit(main())
