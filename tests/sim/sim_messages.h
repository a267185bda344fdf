// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The messages between simulated workers and the coordinator, from the values of one side to those
// of the other, as the wire does it.
#pragma once

#include <string>

#include "coordinator/service/farm/farm.h"
#include "worker/agent/work.h"

namespace sheaf::sim {

// The lease as it reaches the worker, with whatever it must return with its result.
worker::Lease ToWorkerLease(const coordinator::LeaseGrant& grant);
coordinator::ResultReport ToReport(const std::string& worker_id, const std::string& identity,
                                   const worker::FinishedPart& part);
// The frame of the lease's name.
coordinator::FrameId FrameOf(const worker::Lease& lease);
// The lease that the part's description names.
worker::Lease LeaseOf(const worker::FinishedPart& part);

}  // namespace sheaf::sim
