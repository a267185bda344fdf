# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Links that are slow, lose packets or are cut, and connections that are reset."""
import contextlib
import os
import signal
import struct
import subprocess
import time

import farm
from bench import Bench
from kinds import kind
from slow_link import SlowLink

COORDINATOR_ADDRESS, WORKERS_ADDRESS = "10.77.0.1", "10.77.0.2"
CUT_SECONDS = (0.2, 1.6)  # Around the duration of a lease.
ALL = 1000  # In thousandths of the packets.


class TunnelFarm(farm.Farm):
    """A farm whose workers are in a network namespace of their own."""

    def __init__(self, arguments):
        super().__init__([*arguments, "--insecure-allow-remote"])
        self.holder = self.tunnel = None

    def __enter__(self):
        try:
            self._join_namespaces()
            return super().__enter__()
        except BaseException:  # Python does not call __exit__ if __enter__ has failed.
            self.__exit__()
            raise

    def _join_namespaces(self):
        self.holder = subprocess.Popen(["unshare", "--net", "sleep", "infinity"])
        self.namespace = f"/proc/{self.holder.pid}/ns/net"
        own = os.readlink("/proc/self/ns/net")
        farm.wait_until(lambda: os.readlink(self.namespace) != own, 10, "the namespace")
        self.set_link()
        self.tunnel = subprocess.Popen(
            [os.path.join(farm.programs(), "sheaf_slow_tunnel"), self.path("tunnel"),
             self.namespace, COORDINATOR_ADDRESS, WORKERS_ADDRESS], stdout=subprocess.PIPE)
        assert self.tunnel.stdout.readline() == b"up\n", "no tunnel"

    def __exit__(self, *error):
        super().__exit__(*error)
        for process in (self.tunnel, self.holder):
            if process is not None:
                process.kill()
                process.wait()

    def set_link(self, delay_ms=0, jitter_ms=0, lost_to_workers=0, lost_to_coordinator=0):
        """The losses are of a thousand packets."""
        mode = "r+b" if os.path.exists(self.path("tunnel")) else "wb"
        with open(self.path("tunnel"), mode) as file:
            file.write(struct.pack("=4q", delay_ms * 1000, jitter_ms * 1000, lost_to_workers,
                                   lost_to_coordinator))

    def set_device(self, of_workers, state):
        inside = ["nsenter", "--net=" + self.namespace] if of_workers else []
        subprocess.run([*inside, "ip", "link", "set", "tunnel0", state], check=True)

    def _start(self, name, arguments):
        if name.startswith("worker"):
            arguments = ["nsenter", "--net=" + self.namespace, *arguments]
        return super()._start(name, arguments)

    def start_coordinator(self):
        self.address = "0.0.0.0:" + self.address.rpartition(":")[2]
        super().start_coordinator()

    def start_worker(self, *arguments, **options):
        own = self.address
        self.address = COORDINATOR_ADDRESS + ":" + own.rpartition(":")[2]
        try:
            return super().start_worker("--insecure", *arguments, **options)
        finally:
            self.address = own


def tunnel(name):
    return kind(name, bench="tunnel", needs="tunnels")


def impair(bench, seconds, **link):
    bench.begin()
    with bench.fault():
        bench.farm.set_link(**link)
        bench.pause(*seconds)
        bench.farm.set_link()


@tunnel("link is slow: 100 ms one way, 60 ms of jitter")
def link_slow(bench):
    impair(bench, (0.3, 1.0), delay_ms=100, jitter_ms=60)


@tunnel("link loses a tenth of its packets")
def link_lossy(bench):
    impair(bench, (0.3, 1.0), delay_ms=2, lost_to_workers=100, lost_to_coordinator=100)


@tunnel("link is slow and loses packets from the begin on")
def link_poor(bench):
    with bench.fault():
        bench.farm.set_link(delay_ms=40, jitter_ms=20, lost_to_workers=20, lost_to_coordinator=20)
        bench.begin()
        bench.farm.set_link()


@tunnel("workers hear nothing: one direction is cut")
def cut_to_workers(bench):
    impair(bench, CUT_SECONDS, lost_to_workers=ALL)


@tunnel("coordinator hears nothing: the other direction is cut")
def cut_to_coordinator(bench):
    impair(bench, CUT_SECONDS, lost_to_coordinator=ALL)


def take_down(bench, ends):
    bench.begin()
    with bench.fault():
        for end in ends:
            bench.farm.set_device(end, "down")
        bench.pause(*CUT_SECONDS)
        for end in ends:
            bench.farm.set_device(end, "up")


@tunnel("workers' end of the link is down")
def down_at_workers(bench):
    take_down(bench, [True])


@tunnel("coordinator's end of the link is down")
def down_at_coordinator(bench):
    take_down(bench, [False])


@tunnel("both ends of the link are down")
def down_at_both(bench):
    take_down(bench, [True, False])


# The firewall of the machine on which the coordinator runs.

@contextlib.contextmanager
def firewall_rule(rule):
    """Within, the rule applies to packets that arrive through the tunnel."""
    subprocess.run(["nft", "-f", "-"], check=True, text=True,
                   input="table inet faults {\nchain arriving {\n"
                         "type filter hook input priority 0\n"
                         f"iifname tunnel0 {rule}\n}}\n}}\n")
    try:
        yield
    finally:
        subprocess.run(["nft", "delete", "table", "inet", "faults"], check=True)


def filter_packets(bench, rule):
    bench.begin()
    with bench.fault(), firewall_rule(rule):
        bench.pause(*CUT_SECONDS)


def firewall(name):
    return kind(name, bench="tunnel", needs="nft")


@firewall("firewall drops a tenth of the packets")
def firewall_lossy(bench):
    filter_packets(bench, "numgen random mod 10 < 1 drop")


@firewall("firewall drops all packets of the workers")
def firewall_silent(bench):
    filter_packets(bench, "drop")


@firewall("firewall refuses the workers' connections")
def firewall_refuses(bench):
    filter_packets(bench, "meta l4proto tcp reject with tcp reset")


class ProxyFarm(farm.Farm):
    """A farm whose workers reach the coordinator through a proxy."""

    def __init__(self, arguments):
        super().__init__(arguments)
        self.links = contextlib.ExitStack()
        self.link = None

    def __exit__(self, *error):
        super().__exit__(*error)
        self.links.close()

    def start_coordinator(self):
        super().start_coordinator()
        if self.link is None:
            self.link = self.links.enter_context(SlowLink(self.address, 0))

    def start_worker(self, *arguments, **options):
        own, self.address = self.address, self.link.address
        try:
            return super().start_worker(*arguments, **options)
        finally:
            self.address = own


@kind("connections are reset", bench="proxy")
def connections_reset(bench):
    bench.begin()
    with bench.fault():
        bench.farm.link.reset()


@kind("connections are reset again and again", bench="proxy")
def connections_reset_often(bench):
    bench.begin()
    with bench.fault():
        for _ in range(5):
            bench.farm.link.reset()
            bench.pause(0.02, 0.15)


@kind("connections are reset, and new ones for a time too", bench="proxy")
def connections_refused(bench):
    bench.begin()
    with bench.fault():
        bench.farm.link.reset(refuse=True)
        bench.pause(*CUT_SECONDS)
        bench.farm.link.accept()


BENCHES = {"tunnel": TunnelFarm, "proxy": ProxyFarm}
