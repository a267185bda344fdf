# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Disks that are full, broken or read-only, and files whose bits change on them."""
import contextlib
import errno
import os
import shutil
import signal
import subprocess

import farm
from damaged_files import alter, blob_path, flip_bit
from kinds import kind

BALLAST_PIECE_BYTES_MIN = 4 << 10


def heals(bench, told_within=10):
    """Waits until the coordinator tells of the disk, and for a moment more."""
    farm.wait_until(bench.waiting_reason, told_within, "words about the disk")
    bench.tell("is not writable" in bench.waiting_reason()
               or "takes no writes" in bench.waiting_reason())
    bench.pause(0, 0.2)


@contextlib.contextmanager
def workers_held(bench):
    """They stand still within."""
    for worker in bench.farm.workers:
        worker.send_signal(signal.SIGSTOP)
    try:
        yield
    finally:
        for worker in bench.farm.workers:
            worker.send_signal(signal.SIGCONT)


def fill_disk(ballast):
    """Takes all space, while others take of it too."""
    piece = shutil.disk_usage(os.path.dirname(ballast)).free
    taken = 0
    with open(ballast, "wb") as file:
        while piece > BALLAST_PIECE_BYTES_MIN:
            try:
                os.posix_fallocate(file.fileno(), taken, piece)
                taken += piece
            except OSError:  # No so much is left.
                piece //= 2


@kind("disk full", must_tell=True, needs="mounts")
def disk_full(bench):
    """The coordinator's state directory is on a small file system, which a file fills."""
    bench.begin()
    ballast = bench.farm.path("state", "ballast")
    with bench.fault():
        with workers_held(bench):  # Filling takes as long as the job.
            fill_disk(ballast)
        heals(bench)
        os.remove(ballast)


def writes_fail(bench, error):
    bench.begin()
    with bench.fault():
        bench.faults.set(write_error=error)
        heals(bench)
        bench.faults.set()


@kind("writes fail: input/output error", must_tell=True)
def input_output_error(bench):
    writes_fail(bench, errno.EIO)


@kind("disk becomes read-only", must_tell=True)
def read_only(bench):
    writes_fail(bench, errno.EROFS)


@kind("disk is read-only at the start", must_tell=True, needs="mounts")
def read_only_at_start(bench):
    bench.begin()
    state = bench.farm.path("state")
    with bench.fault():
        bench.kill_coordinator()
        subprocess.run(["mount", "-o", "remount,ro", state], check=True)
        log_length = len(bench.farm.log("coordinator"))
        try:
            bench.farm.start_coordinator()
            bench.kill_coordinator()
        except AssertionError:
            pass  # It ended.
        bench.tell("Read-only file system" in bench.farm.log("coordinator")[log_length:])
        subprocess.run(["mount", "-o", "remount,rw", state], check=True)
        bench.restart_coordinator()


# Files whose bits change.

def stored_parts(bench):
    number = bench.job.rpartition("/")[2]
    found = []
    for folder, _, names in os.walk(bench.farm.path("state", "parts")):
        if number in os.path.relpath(folder, bench.farm.path("state", "parts")).split(os.sep):
            found += [os.path.join(folder, name) for name in names if ".tmp" not in name]
    assert found, "no part is stored"
    return found


@kind("bit of a stored part changes")
def part_changed(bench):
    bench.begin()
    with bench.fault():
        flip_bit(bench.random.choice(stored_parts(bench)), bench.random)


@kind("bit of a stored part changes while the coordinator is down", must_tell=True)
def part_changed_while_down(bench):
    bench.begin()
    with bench.fault():
        bench.kill_coordinator()
        flip_bit(bench.random.choice(stored_parts(bench)), bench.random)
        bench.restart_coordinator()
    farm.wait_until(lambda: bench.watch.poll() is not None, 60, "the image")
    bench.tell(bench.metric("sheaf_parts_revoked_total") > 0
               and "do not match the digest" in bench.farm.log("coordinator"))


@kind("bit of a scene's file changes in the coordinator's store", must_tell=True)
def blob_changed(bench):
    """Before workers have it. The client that submits the scene again repairs it."""
    bench.scene = scene = bench.new_scene()
    with bench.fault():
        with workers_held(bench):
            bench.begin(progress=False)
            flip_bit(blob_path(bench.farm.path("state", "content"), os.path.getsize(scene)),
                     bench.random)
        farm.wait_until(lambda: os.path.basename(scene) in bench.waiting_reason(), 30,
                        "words about the file")
        bench.tell("submit the scene again" in bench.waiting_reason())
        again = bench.submit()
    bench.farm.sheaf("cancel", again)


@kind("byte of a texture changes in the workers' cache", must_tell=True)
def cache_changed(bench):
    bench.begin()
    with bench.fault():
        alter(blob_path(bench.farm.path("cache", "blobs"), os.path.getsize(bench.texture)))
    farm.wait_until(lambda: bench.watch.poll() is not None, 60, "the image")
    bench.tell("wood.png" in bench.failures())


def delivered_image(bench):
    bench.begin(progress=False)
    farm.wait_until(lambda: bench.watch.poll() is not None, 60, "the image")
    number = bench.job.rpartition("/")[2]
    images = [os.path.join(folder, name)
              for folder, _, names in os.walk(bench.farm.path("state", "outputs", number))
              for name in names if name.endswith(".exr") and "thumbnail" not in name]
    assert len(images) == 1, images
    return images[0]


def spoil_delivered(bench, spoil):
    image = delivered_image(bench)
    with bench.fault():
        spoil(image)
        said = bench.farm.sheaf("watch", bench.job, "-o", bench.farm.path("spoilt.exr"),
                                check=False)
        bench.tell(said.returncode != 0 and "being recreated" in said.stderr)
    bench.follow()


@kind("bit of a delivered image changes", must_tell=True)
def delivered_changed(bench):
    spoil_delivered(bench, lambda path: flip_bit(path, bench.random))


@kind("delivered image is removed", must_tell=True)
def delivered_removed(bench):
    spoil_delivered(bench, os.remove)


# The database.

def database(bench):
    return bench.farm.path("state", "farm.db")


@kind("bit of the database changes while the coordinator is down", bench="database", spoils=True)
def database_changed_while_down(bench):
    """A start that finds the damage says what to do, and a copy is put back; where it finds none,
    work goes on, and no image may be wrong."""
    bench.begin()
    with bench.fault():
        bench.stop_coordinator()
        before = bench.acknowledged()
        copy = database(bench) + ".copy"
        shutil.copyfile(database(bench), copy)
        flip_bit(database(bench), bench.random)
        log_length = len(bench.farm.log("coordinator"))
        try:
            bench.farm.start_coordinator()
        except AssertionError:
            told = "the database of jobs is damaged" in bench.farm.log("coordinator")[log_length:]
            bench.tell(told, "the damage, and the coordinator did not start")
            shutil.copyfile(copy, database(bench))
            bench.farm.start_coordinator()
        bench.outcome.lost += len(before - bench.acknowledged())
