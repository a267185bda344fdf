# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""A worker that takes all leases it gets, says that it renders them, and delivers nothing. Imports
the stubs of the Python package, which must be on the path.
"""
import threading

import grpc
from sheaf.v1 import worker_pb2, worker_pb2_grpc

CALL_SECONDS_MAX = 30
HEARTBEAT_SECONDS = 0.4
THREADS = 4096  # More than any machine has: each gets leases.


class HoardingWorker:
    def __init__(self, address, worker_id, numeric_profile):
        self.channel = grpc.insecure_channel(address)
        self.service = worker_pb2_grpc.WorkerServiceStub(self.channel)
        self.state = worker_pb2.SynchronizeRequest(
            worker_id=worker_id, host="hoard", numeric_profile=numeric_profile,
            thread_count=THREADS, requested_lease_count=THREADS)
        self.taken = set()  # Ids of all leases that it ever had.
        self.ended = threading.Event()
        self.thread = threading.Thread(target=self._run)

    def __enter__(self):
        self._beat()
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.ended.set()
        self.thread.join()
        self.channel.close()

    def _beat(self):
        answer = self.service.Synchronize(self.state, timeout=CALL_SECONDS_MAX)
        del self.state.leases[:]
        for lease in answer.leases:
            self.taken.add(lease.lease_id)
            self.state.leases.add(lease_id=lease.lease_id,
                                  phase=worker_pb2.LeaseState.PHASE_RENDERING)

    def _run(self):
        while not self.ended.wait(HEARTBEAT_SECONDS):
            self._beat()
