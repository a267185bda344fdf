# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Disks that are full, broken or read-only, and files whose bits change on them."""
import contextlib
import errno
import hashlib
import os
import shutil
import signal
import subprocess

import farm
from bench import WORKERS
from damaged_files import alter, flip_bit
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
            except OSError:  # Less is left.
                piece //= 2


@kind("disk full", bench="disk", must_tell=True, needs="mounts")
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


@kind("writes fail: input/output error", bench="disk", must_tell=True)
def input_output_error(bench):
    writes_fail(bench, errno.EIO)


@kind("disk becomes read-only", bench="disk", must_tell=True)
def read_only(bench):
    writes_fail(bench, errno.EROFS)


@kind("disk is read-only at the start", bench="disk", must_tell=True, needs="mounts")
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


@kind("bit of a stored part changes", bench="files")
def part_changed(bench):
    bench.begin()
    with bench.fault():
        flip_bit(bench.random.choice(stored_parts(bench)), bench.random)


@kind("bit of a stored part changes while the coordinator is down", bench="files", must_tell=True)
def part_changed_while_down(bench):
    bench.begin()
    with bench.fault():
        bench.kill_coordinator()
        flip_bit(bench.random.choice(stored_parts(bench)), bench.random)
        bench.restart_coordinator()
    farm.wait_until(lambda: bench.watch.poll() is not None, 60, "the image")
    bench.tell(bench.metric("sheaf_parts_revoked_total") > 0
               and "do not match the digest" in bench.farm.log("coordinator"))


def stored_at(folder, path):
    """Where a store of blobs keeps the file of a path."""
    name = hashlib.sha256(farm.read_bytes(path)).hexdigest()
    return os.path.join(folder, name[:2], name)


def blobs(folder):
    """The paths of the complete blobs below a folder."""
    return [os.path.join(directory, name) for directory, _, names in os.walk(folder)
            for name in names if len(name) == 64 and "damaged" not in directory]


@kind("bit of a scene's file changes in the coordinator's store", bench="files", must_tell=True)
def blob_changed(bench):
    """Before workers have it. The client that submits the scene again repairs it."""
    bench.scene = scene = bench.new_scene()
    with bench.fault():
        with workers_held(bench):
            bench.begin(progress=False)
            flip_bit(stored_at(bench.farm.path("state", "content"), scene), bench.random)
        farm.wait_until(lambda: os.path.basename(scene) in bench.waiting_reason(), 30,
                        "words about the file")
        bench.tell("submit the scene again" in bench.waiting_reason())
        again = bench.submit()
    bench.farm.sheaf("cancel", again)


@kind("bit of any file of a scene changes in the coordinator's store while it is down",
      bench="files", must_tell=True)
def blob_changed_while_down(bench):
    """The scene's file or its manifest, before workers have it."""
    bench.scene = bench.new_scene()
    store = bench.farm.path("state", "content")
    known = set(blobs(store))
    with bench.fault():
        with workers_held(bench):
            bench.begin(progress=False)
            bench.kill_coordinator()
            flip_bit(bench.random.choice(sorted(set(blobs(store)) - known)), bench.random)
            bench.restart_coordinator()
        farm.wait_until(lambda: "submit the scene again" in bench.waiting_reason(), 30,
                        "words about the file")
        bench.tell(True)
        again = bench.submit()
    bench.farm.sheaf("cancel", again)


@kind("byte of a texture changes in the workers' cache", bench="files", must_tell=True)
def cache_changed(bench):
    bench.begin()
    with bench.fault():
        alter(stored_at(bench.farm.path("cache", "blobs"), bench.texture))
    farm.wait_until(lambda: bench.watch.poll() is not None, 60, "the image")
    bench.tell("wood.png" in bench.failures())


@kind("bit of a scene's file changes in the workers' cache while they are down", bench="files",
      must_tell=True)
def cache_changed_while_down(bench):
    """The scene's own file or its texture. Workers find it before they use it, and fetch it
    again."""
    cache = bench.farm.path("cache", "blobs")
    path = stored_at(cache, bench.random.choice([bench.scene, bench.texture]))
    whole = farm.read_bytes(path)
    with bench.fault():
        for worker in list(bench.farm.workers):
            bench.farm.kill(worker)
        shutil.rmtree(os.path.join(cache, "damaged"), ignore_errors=True)
        flip_bit(path, bench.random)
        for _ in range(WORKERS):
            bench.start_worker()
    bench.begin(progress=False)
    farm.wait_until(lambda: bench.watch.poll() is not None, 60, "the image")
    bench.tell(os.path.exists(os.path.join(cache, "damaged", os.path.basename(path))),
               "the file, which is set aside")
    assert farm.read_bytes(path) == whole, "the file was not fetched again"


@kind("byte of a texture changes in the workers' cache while they load the scene", bench="files")
def cache_changed_while_loading(bench):
    texture = stored_at(bench.farm.path("cache", "blobs"), bench.texture)
    with bench.fault():
        for worker in list(bench.farm.workers):
            bench.farm.kill(worker)
        shutil.rmtree(bench.farm.path("cache"))
        for _ in range(WORKERS):
            bench.start_worker()
        bench.begin(progress=False)
        farm.wait_until(lambda: os.path.exists(texture), 30, "the texture")
        bench.pause(0, 0.3)
        alter(texture)


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


@kind("bit of a delivered image changes", bench="files", must_tell=True)
def delivered_changed(bench):
    spoil_delivered(bench, lambda path: flip_bit(path, bench.random))


@kind("delivered image is removed", bench="files", must_tell=True)
def delivered_removed(bench):
    spoil_delivered(bench, os.remove)
