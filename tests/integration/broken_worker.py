# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""A worker with a broken renderer: it takes leases as any worker and delivers bytes that are no
part. Imports the stubs of the Python package, which must be on the path.
"""
import hashlib

import grpc
from sheaf.v1 import worker_pb2, worker_pb2_grpc

CALL_SECONDS_MAX = 30


class BrokenWorker:
    def __init__(self, address, worker_id, numeric_profile):
        self.channel = grpc.insecure_channel(address)
        self.service = worker_pb2_grpc.WorkerServiceStub(self.channel)
        self.state = worker_pb2.SynchronizeRequest(
            worker_id=worker_id, host="broken", numeric_profile=numeric_profile, thread_count=1,
            requested_lease_count=1)

    def close(self):
        self.channel.close()

    def deliver(self):
        """Asks for a lease, delivers its result. The answer's code; None without a lease."""
        answer = self.service.Synchronize(self.state, timeout=CALL_SECONDS_MAX)
        if not answer.leases:
            return None
        lease, part = answer.leases[0], b"not an EXR"
        digest = worker_pb2.ResultHeader().digest
        digest.sha256_hex, digest.size_bytes = hashlib.sha256(part).hexdigest(), len(part)
        header = worker_pb2.ResultHeader(
            key=lease.key, lease_id=lease.lease_id, worker_id=self.state.worker_id, digest=digest,
            token=lease.token, ray_count=1)
        request = worker_pb2.UploadResultsRequest(header=header, chunk=part)
        try:
            self.service.UploadResults(iter([request]), timeout=CALL_SECONDS_MAX)
        except grpc.RpcError as error:
            return error.code()
        return grpc.StatusCode.OK
