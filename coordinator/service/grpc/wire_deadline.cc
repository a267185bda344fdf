// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Deadlines of jobs, on the wire.
#include <cmath>

#include "coordinator/service/grpc/wire.h"

namespace sheaf::coordinator {
namespace {

// Times beyond this range are mistakes, not deadlines.
constexpr int64_t kDeadlineSecondsMax = 253'402'300'799;  // The end of 9999.

}  // namespace

absl::Status ReadDeadline(const v1::CreateJobRequest& request, JobSpec* spec) {
  if (!request.has_deadline()) return absl::OkStatus();
  const v1::Deadline& wire = request.deadline();
  const int64_t seconds = wire.time().seconds();
  const int32_t nanos = wire.time().nanos();
  if (seconds <= 0 || seconds > kDeadlineSecondsMax || nanos < 0 || nanos > 999'999'999) {
    return absl::InvalidArgumentError("deadline: its time is outside 1970 to 9999");
  }
  spec->deadline.time = absl::FromUnixSeconds(seconds) + absl::Nanoseconds(nanos);
  if (!wire.has_cpu_seconds()) return absl::OkStatus();
  const v1::Estimate& quoted = wire.cpu_seconds();
  if (!std::isfinite(quoted.high()) || !(quoted.low() >= 0) || !(quoted.value() > 0) ||
      !(quoted.low() <= quoted.value()) || !(quoted.value() <= quoted.high())) {
    return absl::InvalidArgumentError(
        "deadline: its quoted CPU time must be finite, above 0 and within its band");
  }
  spec->deadline.cpu_seconds = quoted.value();
  spec->deadline.cpu_seconds_low = quoted.low();
  spec->deadline.cpu_seconds_high = quoted.high();
  return absl::OkStatus();
}

}  // namespace sheaf::coordinator
