# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Bits of the coordinator's database that change, and the ways back that its messages name."""
import contextlib
import os
import shutil
import sqlite3
import struct
import subprocess

import farm
from damaged_files import flip_bit, overwrite
from kinds import kind

PAGE_HEADER_BYTES = 8  # In a leaf; the first byte is the page's type.
FILE_HEADER_BYTES = 100  # Before the page header of the first page.
ROWS_OF_A_JOB = ("jobs", "frames", "parts")


def database(bench):
    return bench.farm.path("state", "farm.db")


def put_back(bench, copy):
    for log in ("-wal", "-shm"):
        with contextlib.suppress(FileNotFoundError):
            os.remove(database(bench) + log)
    shutil.copyfile(copy, database(bench))


def copy_of(bench):
    """A copy of the database of a coordinator that is stopped."""
    copy = bench.farm.path("copy.db")
    shutil.copyfile(database(bench), copy)
    return copy


def refuses(bench):
    """Starts the coordinator; returns whether it refuses. Then its words must say what to do."""
    log_length = len(bench.farm.log("coordinator"))
    try:
        bench.farm.start_coordinator()
        return False
    except AssertionError:
        said = bench.farm.log("coordinator")[log_length:]
        assert bench.farm.coordinator.poll() is not None, "it neither starts nor ends"
        bench.tell(all(words in said for words in (
            database(bench), "the database of jobs is damaged", "from a backup", "start again")),
            "the damage, and the coordinator did not start: " + said)
        return True


def submit_again_if_job_is_gone(bench):
    """A job whose rows changed or are lost ends with a message; then its scene is submitted again.
    Returns whether that was so."""
    shown = bench.farm.sheaf("show", bench.job, "--json", check=False)
    said = shown.stdout + shown.stderr
    if shown.returncode == 0 and "changed since it was stored" not in said:
        return False
    bench.tell("submit the scene again" in said or shown.returncode != 0, "the job: " + said)
    bench.watch.kill()
    bench.watch.wait()
    bench.job = bench.submit()
    bench.follow()
    return True


def change_while_down(bench, change):
    """A start that finds the damage says what to do, and a copy is put back; where it finds none,
    work continues, and no image may be wrong. Parts whose rows changed are revoked."""
    bench.begin()
    with bench.fault():
        bench.stop_coordinator()
        before = bench.acknowledged()
        copy = copy_of(bench)
        change(database(bench))
        if refuses(bench):
            put_back(bench, copy)
            bench.farm.start_coordinator()
        revoked = int(bench.metric("sheaf_parts_revoked_total"))
        gone = len(before - bench.acknowledged())
        if not submit_again_if_job_is_gone(bench):
            bench.outcome.lost += max(0, gone - revoked)


@kind("bit of the database changes while the coordinator is down", bench="database", spoils=True)
def changed_while_down(bench):
    change_while_down(bench, lambda path: flip_bit(path, bench.random))


# Places in the file.

def pages_of(path, tables):
    """The bytes (first, end) of each leaf of these tables that hold rows."""
    with contextlib.closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as db:
        marks = ",".join("?" * len(tables))
        pages = db.execute(f"SELECT pgoffset, pgsize FROM dbstat WHERE name IN ({marks}) AND "
                           "pagetype = 'leaf' AND ncell > 0", tables).fetchall()
    data = farm.read_bytes(path)
    found = []
    for offset, size in pages:
        header = offset + (FILE_HEADER_BYTES if offset == 0 else 0)
        content, = struct.unpack_from(">H", data, header + 5)
        found.append((header, offset + (content or 1 << 16), offset + size))
    return found


def flip_bit_within(path, first, end, random):
    def flip(data):
        data[random.randrange(first, end)] ^= 1 << random.randrange(8)
    overwrite(path, flip)


@kind("bit of a job's rows in the database changes while the coordinator is down",
      bench="database", spoils=True)
def row_changed_while_down(bench):
    """SQLite's checks do not see most of these. The job ends with a message, its parts are rendered
    again, or nothing of its image has changed."""
    def change(path):
        _, first, end = bench.random.choice(pages_of(path, ROWS_OF_A_JOB))
        flip_bit_within(path, first, end, bench.random)
    change_while_down(bench, change)


def damage_page(bench, tables):
    """Changes the type of a page, which no start overlooks."""
    header, _, _ = bench.random.choice(pages_of(database(bench), tables))
    flip_bit_within(database(bench), header, header + 1, bench.random)


def run_sqlite(command):
    subprocess.run(["bash", "-e", "-o", "pipefail", "-c", command], check=True,
                   capture_output=True, text=True)


@kind("page of the database is damaged, and a backup restored", bench="database",
      must_tell=True, needs="sqlite3")
def backup_restored(bench):
    """The backup is made while the coordinator works, and the job continues after it."""
    backup = bench.farm.path("backup.db")
    bench.begin()
    run_sqlite(f"sqlite3 '{database(bench)}' \".backup '{backup}'\"")
    bench.pause(0, 0.2)
    with bench.fault():
        bench.stop_coordinator()
        damage_page(bench, ROWS_OF_A_JOB)
        assert refuses(bench), "the damage is overlooked"
        put_back(bench, backup)
        bench.restart_coordinator()


@kind("page of the database is damaged, and the farm starts anew", bench="database",
      must_tell=True, spoils=True)
def started_anew(bench):
    """Where there is no backup: the state directory is moved away, the scene submitted again."""
    bench.begin()
    with bench.fault():
        bench.stop_coordinator()
        damage_page(bench, ROWS_OF_A_JOB)
        assert refuses(bench), "the damage is overlooked"
        os.rename(bench.farm.path("state"), bench.farm.path("damaged state"))
        bench.farm.start_coordinator()
        bench.watch.kill()
        bench.watch.wait()
        bench.job = bench.submit()
        bench.follow()


@kind("page of the database is damaged, and its rows recovered", bench="database", must_tell=True,
      needs="recover")
def rows_recovered(bench):
    """Applies the last remedy that the message names. Rows of the damaged page are lost with it."""
    bench.begin()
    recovered = bench.farm.path("recovered.db")
    with contextlib.suppress(FileNotFoundError):
        os.remove(recovered)
    with bench.fault():
        bench.stop_coordinator()
        damage_page(bench, ROWS_OF_A_JOB)
        assert refuses(bench), "the damage is overlooked"
        run_sqlite(f"sqlite3 '{database(bench)}' .recover | sqlite3 '{recovered}'")
        put_back(bench, recovered)
        bench.restart_coordinator()
        submit_again_if_job_is_gone(bench)


def why_not_recover():
    """Why the SQLite's shell of this machine cannot recover rows; "" where it can."""
    done = subprocess.run(["sqlite3", ":memory:", "SELECT count(*) FROM sqlite_dbpage"],
                          capture_output=True, text=True, check=False)
    return "" if done.returncode == 0 else "this sqlite3 has no .recover: " + done.stderr.strip()


@kind("bit of the database changes while the coordinator works", bench="database", spoils=True)
def changed_while_working(bench):
    """The damage shows only when it is read. Then writes wait, with a message, and a backup is
    restored."""
    backup = bench.farm.path("backup.db")
    bench.begin()
    with bench.fault():
        run_sqlite(f"sqlite3 '{database(bench)}' \".backup '{backup}'\"")
        flip_bit(database(bench), bench.random)
        farm.wait_until(lambda: bench.watch.poll() is not None or bench.waiting_reason(), 30,
                        "the image, or words about the damage")
        reason = bench.waiting_reason()
        if reason:
            bench.tell(database(bench) in reason, "the damage: " + reason)
            bench.stop_coordinator()
            if not refuses(bench):
                bench.stop_coordinator()
            put_back(bench, backup)
            bench.restart_coordinator()
