# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""A real Slurm on this machine: munged, slurmctld and virtual nodes, each a slurmd with a name of
its own. All files are in a temporary folder. Needs root.
"""
import os
import shutil
import signal
import subprocess
import tempfile
import time

START_SECONDS_MAX = 60
SLURMD_TIMEOUT_SECONDS = 5  # A silent node is down after it.
# More than the --grace-seconds of the workers.
PREEMPTION_GRACE_SECONDS = KILL_WAIT_SECONDS = 30

CONFIGURATION = """\
ClusterName=sheaf
SlurmctldHost=localhost
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge/socket
CryptoType=crypto/munge
SlurmctldPort={port}
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd-%n.pid
SlurmdSpoolDir={folder}/spool/%n
StateSaveLocation={folder}/state
SlurmctldLogFile={folder}/log/slurmctld.log
SlurmdLogFile={folder}/log/slurmd-%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
JobCompType=jobcomp/none
SwitchType=switch/none
MpiDefault=none
ReturnToService=2
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerType=sched/backfill
SchedulerParameters=sched_interval=1,batch_sched_delay=0,bf_interval=1,requeue_delay=1,\
preempt_send_user_signal
PreemptType=preempt/partition_prio
PreemptMode=REQUEUE
PreemptExemptTime=0
SlurmctldTimeout=30
SlurmdTimeout={slurmd_timeout}
MinJobAge=10
KillWait={kill_wait}
SlurmdParameters=config_overrides
NodeName=n[1-{nodes}] NodeHostname=localhost NodeAddr=127.0.0.1 Port=[{first}-{last}] CPUs=1 \
RealMemory=4000 State=UNKNOWN
PartitionName=render Nodes=n[1-{nodes}] Default=YES MaxTime=INFINITE State=UP PriorityTier=1 \
GraceTime={grace}
PartitionName=urgent Nodes=n[1-{nodes}] MaxTime=INFINITE State=UP PriorityTier=2 PreemptMode=OFF
"""


class Cluster:
    """Use with `with`. nodes: how many. port: the first of nodes + 1 ports of loopback."""

    def __init__(self, nodes=8, port=16917):
        self.nodes = [f"n{number}" for number in range(1, nodes + 1)]
        self._port = port
        self.folder = tempfile.mkdtemp(prefix="sheaf-slurm-")
        self.environment = dict(os.environ,
                                SLURM_CONF=os.path.join(self.folder, "etc", "slurm.conf"))
        self._munged = self._controller = None
        self._slurmds = {}

    def path(self, *names):
        return os.path.join(self.folder, *names)

    def __enter__(self):
        try:
            self._start()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        for node in list(self._slurmds):
            self.kill_node(node)
        for process in (self._controller, self._munged):
            if process is not None and process.poll() is None:
                process.kill()
                process.wait()
        if os.environ.get("SHEAF_KEEP"):
            print("kept", self.folder)
        else:
            shutil.rmtree(self.folder, ignore_errors=True)

    def _start(self):
        for name in ("munge", "etc", "log", "state", *("spool/" + node for node in self.nodes)):
            os.makedirs(self.path(name), mode=0o755)
        os.chmod(self.folder, 0o755)
        with open(self.path("munge", "key"), "wb") as file:
            file.write(os.urandom(128))
        os.chmod(self.path("munge", "key"), 0o600)
        with open(self.path("etc", "slurm.conf"), "w", encoding="utf-8") as file:
            file.write(CONFIGURATION.format(
                folder=self.folder, port=self._port, nodes=len(self.nodes), first=self._port + 1,
                last=self._port + len(self.nodes), slurmd_timeout=SLURMD_TIMEOUT_SECONDS,
                grace=PREEMPTION_GRACE_SECONDS, kill_wait=KILL_WAIT_SECONDS))
        self._munged = subprocess.Popen(
            ["munged", "--foreground", "--force", f"--socket={self.path('munge', 'socket')}",
             f"--key-file={self.path('munge', 'key')}", f"--pid-file={self.path('munge', 'pid')}",
             f"--log-file={self.path('munge', 'log')}",
             f"--seed-file={self.path('munge', 'seed')}"],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self._wait(lambda: os.path.exists(self.path("munge", "socket")), "munged")
        self.start_controller(clean=True)
        for node in self.nodes:
            self.start_node(node)
        self._wait(lambda: set(self.states().values()) <= {"idle"}, "idle nodes")

    def start_controller(self, clean=False):
        self._controller = subprocess.Popen(
            ["/usr/sbin/slurmctld", *(["-c"] if clean else []), "-D"], env=self.environment,
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self._wait(lambda: self.run("scontrol", "ping", check=False).stdout.count("UP"),
                   "slurmctld")

    def kill_controller(self):
        self._controller.kill()
        self._controller.wait()

    def start_node(self, node):
        self._slurmds[node] = subprocess.Popen(
            ["/usr/sbin/slurmd", "-N", node, "-D"], env=self.environment,
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def kill_node(self, node):
        """As if its power failed: slurmd and all that it has started end at once."""
        process = self._slurmds.pop(node)
        victims = [process.pid]
        for entry in os.scandir("/proc"):
            if entry.name.isdigit() and self._is_of_node(entry.name, node):
                victims.append(int(entry.name))
        for pid in victims:
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                continue
        process.wait()

    def _is_of_node(self, pid, node):
        """Whether Slurm runs the process on the node: by its environment, or as slurmstepd."""
        try:
            with open(f"/proc/{pid}/environ", "rb") as file:
                variables = file.read().split(b"\0")
            with open(f"/proc/{pid}/cmdline", "rb") as file:
                command = file.read()
        except OSError:
            return False
        ours = f"SLURM_CONF={self.environment['SLURM_CONF']}".encode() in variables
        named = f"SLURMD_NODENAME={node}".encode() in variables
        return ours and (named or (b"slurmstepd" in command and self._parent_runs(pid, node)))

    def _parent_runs(self, pid, node):
        try:
            with open(f"/proc/{pid}/task/{pid}/children", encoding="ascii") as file:
                return any(self._is_of_node(child, node) for child in file.read().split())
        except OSError:
            return False

    def run(self, *command, check=True):
        done = subprocess.run(command, env=self.environment, stdin=subprocess.DEVNULL,
                              capture_output=True, text=True, timeout=60, check=False)
        if check and done.returncode:
            raise AssertionError(f"{' '.join(command)}: {done.stderr}")
        return done

    def states(self):
        """The state of each node, as "idle", "mixed", "down*"."""
        text = self.run("sinfo", "-h", "-N", "-p", "render", "-o", "%N %T", check=False).stdout
        return dict(line.split() for line in text.splitlines())

    def resume_drained(self):
        """Resumes drained nodes, as an operator does after a failed launch; returns them."""
        drained = [n for n, state in self.states().items() if "drain" in state or "down" in state]
        for node in drained:
            if node in self._slurmds:
                self.run("scontrol", "update", f"nodename={node}", "state=resume", check=False)
        return drained

    def tasks(self):
        """Running array tasks, as {"7_1": node}."""
        text = self.run("squeue", "-h", "-r", "-t", "RUNNING", "-p", "render", "-o", "%i %N",
                        check=False).stdout
        return dict(line.split() for line in text.splitlines() if len(line.split()) == 2)

    @staticmethod
    def _wait(condition, what):
        end = time.monotonic() + START_SECONDS_MAX
        while not condition():
            if time.monotonic() > end:
                raise AssertionError(f"not within {START_SECONDS_MAX} s: {what}")
            time.sleep(0.1)
