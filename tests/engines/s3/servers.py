# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""S3 servers of different make, as tests/engines/s3/install installs them: s3rver (JavaScript) and
OpenStack Swift with its S3 interface (Python, in a chroot).
"""
import contextlib
import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
import urllib.request

import farm

HERE = os.path.dirname(os.path.abspath(__file__))
INSTALLED = os.environ.get("SHEAF_S3_ENGINES",
                           os.path.join(HERE, "..", "..", "..", "build", "engines", "s3"))
START_SECONDS_MAX = 60 * farm.PATIENCE
CALL_SECONDS_MAX = 60 * farm.PATIENCE


class Server:
    """A server with its data in a folder; use with `with`. size_max: of the file system that holds
    the data, as "32m"; it is full beyond."""

    def __init__(self, size_max=None):
        self.folder = tempfile.mkdtemp(prefix="sheaf-s3-")
        self.size_max = size_max
        self.port = farm.free_port()
        self.processes = []

    def __enter__(self):
        if self.size_max:
            subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={self.size_max}", "tmpfs",
                            self.folder], check=True)
        self.start()
        self.make_bucket()
        return self

    def __exit__(self, *_):
        self.kill()
        if self.size_max:
            subprocess.run(["umount", "-l", self.folder], check=False)
        shutil.rmtree(self.folder, ignore_errors=True)

    def environment(self, port):
        return {"AWS_ACCESS_KEY_ID": self.key, "AWS_SECRET_ACCESS_KEY": self.secret,
                "AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}", "AWS_REGION": "us-east-1"}

    def curl(self, *arguments):
        empty = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
        return subprocess.run(
            ["curl", "-sS", "--aws-sigv4", "aws:amz:us-east-1:s3", "--user",
             f"{self.key}:{self.secret}", "-H", f"x-amz-content-sha256: {empty}", *arguments],
            capture_output=True, text=True, check=True, timeout=CALL_SECONDS_MAX).stdout

    def make_bucket(self):
        self.curl("-X", "PUT", f"http://127.0.0.1:{self.port}/farm")

    def kill(self):
        """As a crash."""
        for process in self.processes:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        self.processes = []

    def run(self, *command, **environment):
        log = open(os.path.join(self.folder, "log"), "ab")
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log,
                                   start_new_session=True, env={**os.environ, **environment})
        log.close()
        self.processes.append(process)

    def await_port(self):
        end = time.monotonic() + START_SECONDS_MAX
        while time.monotonic() < end:
            with contextlib.suppress(OSError):
                socket.create_connection(("127.0.0.1", self.port), 1).close()
                return
            time.sleep(0.1)
        with open(os.path.join(self.folder, "log"), errors="replace", encoding="utf-8") as log:
            raise AssertionError("the server does not listen:\n" + log.read()[-2000:])


class S3rver(Server):
    name, key, secret = "s3rver", "S3RVER", "S3RVER"

    def start(self):
        self.run(os.path.join(INSTALLED, "node_modules", ".bin", "s3rver"), "-d",
                 os.path.join(self.folder, "data"), "-a", "127.0.0.1", "-p", str(self.port),
                 # Its tokens of long lists are encrypted by a cipher that OpenSSL 3 gave up.
                 NODE_OPTIONS="--openssl-legacy-provider")
        self.await_port()


SWIFT_SERVER = """[DEFAULT]
bind_ip = 127.0.0.1
bind_port = {port}
workers = 0
user = root
swift_dir = /srv/etc
devices = /srv/devices
mount_check = false
disable_fallocate = true
[pipeline:main]
pipeline = {name}-server
[app:{name}-server]
use = egg:swift#{name}
"""
SWIFT_PROXY = """[DEFAULT]
bind_ip = 127.0.0.1
bind_port = {port}
workers = 0
user = root
swift_dir = /srv/etc
[pipeline:main]
pipeline = catch_errors gatekeeper cache listing_formats bulk s3api tempauth slo dlo proxy-server
[app:proxy-server]
use = egg:swift#proxy
account_autocreate = true
[filter:catch_errors]
use = egg:swift#catch_errors
[filter:gatekeeper]
use = egg:swift#gatekeeper
[filter:cache]
use = egg:swift#memcache
memcache_servers = 127.0.0.1:{memcache}
[filter:listing_formats]
use = egg:swift#listing_formats
[filter:bulk]
use = egg:swift#bulk
[filter:s3api]
use = egg:swift#s3api
location = us-east-1
[filter:tempauth]
use = egg:swift#tempauth
user_test_tester = testing .admin
[filter:slo]
use = egg:swift#slo
[filter:dlo]
use = egg:swift#dlo
"""


# The program swift-ring-builder takes three starts for a ring, each of a second and more.
SWIFT_RINGS = """import sys
from swift.common.ring import RingBuilder
for argument in sys.argv[1:]:
    name, port = argument.split("=")
    builder = RingBuilder(part_power=4, replicas=1, min_part_hours=1)
    builder.add_dev({"region": 1, "zone": 1, "ip": "127.0.0.1", "port": int(port), "device": "d1",
                     "weight": 1.0, "replication_ip": "127.0.0.1", "replication_port": int(port),
                     "meta": ""})
    builder.rebalance()
    builder.get_ring().save("/srv/etc/" + name + ".ring.gz")
"""


class Swift(Server):
    """Account, container and object server with one device, memcached, and the proxy with s3api."""
    name, key, secret = "swift", "test:tester", "testing"

    def make_bucket(self):
        """By Swift's own interface: the program curl cannot sign by a key with a colon."""
        origin = f"http://127.0.0.1:{self.port}"
        ask = urllib.request.Request(origin + "/auth/v1.0", headers={
            "X-Auth-User": self.key, "X-Auth-Key": self.secret})
        with urllib.request.urlopen(ask, timeout=CALL_SECONDS_MAX) as answer:
            token, account = answer.headers["X-Auth-Token"], answer.headers["X-Storage-Url"]
        make = urllib.request.Request(account + "/farm", method="PUT",
                                      headers={"X-Auth-Token": token})
        urllib.request.urlopen(make, timeout=CALL_SECONDS_MAX).close()

    def inside(self, command):
        """A command in the chroot, with the server's folder as /srv."""
        root = os.path.join(INSTALLED, "swift")
        return ["unshare", "-m", "sh", "-c",
                f"mount --bind '{self.folder}' '{root}/srv' && mount -t proc proc '{root}/proc' && "
                f"exec chroot '{root}' {command}"]

    def configure(self):
        etc = os.path.join(self.folder, "etc")
        os.makedirs(etc)
        os.makedirs(os.path.join(self.folder, "devices", "d1"))
        self.memcache = farm.free_port()

        def write(name, text):
            with open(os.path.join(etc, name), "w", encoding="utf-8") as f:
                f.write(text)

        write("swift.conf", "[swift-hash]\nswift_hash_path_suffix = sheaf\n")
        write("proxy.conf", SWIFT_PROXY.format(port=self.port, memcache=self.memcache))
        write("rings.py", SWIFT_RINGS)
        ports = {name: farm.free_port() for name in ("account", "container", "object")}
        for name, port in ports.items():
            write(name + ".conf", SWIFT_SERVER.format(name=name, port=port))
        rings = " ".join(f"{name}={port}" for name, port in ports.items())
        subprocess.run(self.inside("python3 /srv/etc/rings.py " + rings), check=True,
                       timeout=CALL_SECONDS_MAX)

    def start(self):
        if not os.path.exists(os.path.join(self.folder, "etc")):
            self.configure()
        self.run(*self.inside(f"memcached -u root -l 127.0.0.1 -p {self.memcache}"))
        for name in ("account", "container", "object", "proxy"):
            # Swift reads /etc/swift/swift.conf.
            self.run(*self.inside("sh -c 'mkdir -p /etc/swift && cp /srv/etc/swift.conf "
                                  f"/etc/swift && exec swift-{name}-server /srv/etc/{name}.conf'"))
        self.await_port()
        time.sleep(3)  # The three servers behind it.
