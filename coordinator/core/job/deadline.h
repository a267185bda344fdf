// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Deadline: the time by which the submitter wants a job done. It does not change the order of work;
// a program that starts workers may keep enough of them for it (docs/elastic.md).
#pragma once

#include "absl/time/time.h"

namespace sheaf::coordinator {

struct Deadline {
  absl::Time time = absl::InfiniteFuture();  // InfiniteFuture: there is none.
  // CPU time of workers by the job's quote, with the ends of its 80 % band; 0: no quote was made.
  double cpu_seconds = 0, cpu_seconds_low = 0, cpu_seconds_high = 0;
  friend bool operator==(const Deadline&, const Deadline&) = default;
};

}  // namespace sheaf::coordinator
