// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LeaseLength: how many samples a lease has if the job leaves it to the coordinator. Long frames
// get leases of some seconds (Limits::lease_target_seconds). Towards the end of a frame leases
// shrink, so that the last ones end together: a lease has at most 1 / (tail_divisor x slots) of
// the rest, where slots is the number of leases of the job that are rendered at once.
//
// A divisor of 1 gives guided self-scheduling (Polychronopoulos and Kuck 1987, IEEE Transactions on
// Computers C-36), which is optimal if all samples cost the same. They do not, so each round of
// leases takes half of the rest, as in factoring (Hummel, Schonberg and Flynn 1992,
// Communications of the ACM 35), with a divisor of 2.
//
// Blocks of any size give the same bits: all of them are nodes of the canonical tree (ADR 1).
#pragma once

#include <cstdint>

#include "coordinator/core/job/limits.h"

namespace sheaf::coordinator {

struct LeaseLength {
  double samples_per_second = 0;  // Pixel samples of all threads of the lease; 0: not known.
  double target_seconds = 0;
  double samples_left = 0;    // Pixel samples of the frame that can be leased.
  int slots = 1;              // Leases of the job that are rendered at once.
  int64_t pixel_count = 1;    // Pixels of the block.
  uint64_t samples_max = 0;   // Limit per pixel; 0: none.
  uint64_t pass_samples = 1;  // Per pixel; a power of two.
  uint64_t passes_max = 1;    // A power of two.
};

// Returns the samples per pixel of the lease: a power of two of passes, at least one pass. One pass
// if the speed is unknown.
uint64_t LeaseSamples(const LeaseLength& length, const Limits& limits);

}  // namespace sheaf::coordinator
