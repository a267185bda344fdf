// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Parts and images without a renderer: the value of a sample is a function of frame digest, guiding
// field, pixel and sample index. Parts and images are kept in memory, for seeds ask for the same
// ones.
#pragma once

#include <string>

#include "coordinator/core/job/job.h"
#include "worker/agent/work.h"

namespace sheaf::sim {

// The true part of a lease's task, with the lease's guiding field; or that field. The reference is
// valid as long as the program runs.
const std::string& TruePart(const worker::Lease& lease);
// The same of other values, as a broken processor would make it; each kind has values of its own.
std::string FalsePart(const worker::Lease& lease, uint64_t kind);
// The same of values that no renderer makes.
std::string ImpossiblePart(const worker::Lease& lease);

// The digest of the image that one process renders of the frame, all its rounds included. Requires:
// no rule of the frame reads clocks.
const std::string& OneProcessImage(const coordinator::FrameSpec& frame,
                                   const coordinator::Partition& partition);

}  // namespace sheaf::sim
