// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Conversion of what the messages to the coordinator and to a scene's process have in common: the
// key of a task and the class of a failure.
#pragma once

#include "sheaf/v1/worker.pb.h"
#include "worker/agent/work.h"

namespace sheaf::worker {

v1::ResultKey KeyOf(const Lease& lease);
v1::ResultKey KeyOf(const FinishedPart& part);
// Sets what the key says of the lease. Nothing is checked.
void ReadKey(const v1::ResultKey& key, Lease* lease);

v1::LeaseFailure::Kind ToWire(FailureKind kind);
// kInternal for what a scene's process cannot know, or what does not exist.
FailureKind FromWire(v1::LeaseFailure::Kind kind);

}  // namespace sheaf::worker
