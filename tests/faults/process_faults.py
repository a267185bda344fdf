# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Processes that die or stand still, at random and at named points."""
import signal

import farm
from kinds import kind
from machine_faults import AFTER_GROUP, AFTER_RENAME, AFTER_ROW, BEFORE_GROUP, BEFORE_RENAME

STILL_SECONDS = (0.2, 1.6)  # Around the duration of a lease.


@kind("worker killed", bench="processes")
def worker_killed(bench):
    bench.begin()
    with bench.fault():
        bench.farm.kill(bench.any_worker())
        bench.start_worker()


@kind("worker killed while it loads a scene", bench="processes")
def worker_killed_while_loading(bench):
    """It dies when it has fetched a file; both may."""
    bench.scene = bench.new_scene()
    with bench.fault():
        bench.worker_faults.set(kill_point=AFTER_RENAME, kill_path="/blobs/")
        bench.begin(progress=False)
        farm.wait_until(lambda: any(w.poll() is not None for w in bench.farm.workers), 20,
                        "a worker's death at the point")
        bench.worker_faults.set()
        bench.replace_dead_workers()
    farm.wait_until(lambda: bench.watch.poll() is not None, 60, "the image")
    bench.replace_dead_workers()  # The other one may have come there too, and be slow to end.


@kind("coordinator killed", bench="processes")
def coordinator_killed(bench):
    bench.begin()
    with bench.fault():
        bench.kill_coordinator()
        bench.restart_coordinator()


def kill_coordinator_at(bench, point, path=""):
    bench.begin()
    with bench.fault():
        bench.granted += bench.metric("sheaf_leases_granted_total") - bench.granted_at_begin
        bench.granted_at_begin = 0
        bench.faults.set(kill_point=point, kill_path=path)
        assert bench.await_death(bench.farm.coordinator), "the coordinator did not reach the point"
        bench.restart_coordinator()


@kind("coordinator killed after a part's file, before its row", bench="processes")
def coordinator_killed_before_row(bench):
    kill_coordinator_at(bench, AFTER_RENAME, "/parts/")


@kind("coordinator killed when a group of parts is written, before it is durable",
      bench="processes")
def coordinator_killed_before_group(bench):
    kill_coordinator_at(bench, BEFORE_GROUP)


@kind("coordinator killed when a group of parts is durable, before its rows", bench="processes")
def coordinator_killed_after_group(bench):
    kill_coordinator_at(bench, AFTER_GROUP)


@kind("coordinator killed after a part's row, before its acknowledgement", bench="processes")
def coordinator_killed_after_row(bench):
    kill_coordinator_at(bench, AFTER_ROW)


@kind("coordinator killed while it delivers, before the image is in place", bench="processes")
def coordinator_killed_before_image(bench):
    kill_coordinator_at(bench, BEFORE_RENAME, "/outputs/")


@kind("coordinator killed while it delivers, after the image is in place", bench="processes")
def coordinator_killed_after_image(bench):
    kill_coordinator_at(bench, AFTER_RENAME, "/outputs/")


def hold(bench, process):
    with bench.fault():
        process.send_signal(signal.SIGSTOP)
        bench.pause(*STILL_SECONDS)
        process.send_signal(signal.SIGCONT)


@kind("coordinator stands still", bench="processes")
def coordinator_stopped(bench):
    bench.begin()
    hold(bench, bench.farm.coordinator)


@kind("worker stands still", bench="processes")
def worker_stopped(bench):
    bench.begin()
    hold(bench, bench.any_worker())
