// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Times and durations as SqlJobStore stores them: nanoseconds; infinite values are stored as the
// largest number.
#pragma once

#include <cstdint>

#include "absl/time/time.h"

namespace sheaf::coordinator {

inline int64_t ToNanoseconds(absl::Time time) {
  return time == absl::InfiniteFuture() ? INT64_MAX : absl::ToUnixNanos(time);
}
inline absl::Time FromNanoseconds(int64_t ns) {
  return ns == INT64_MAX ? absl::InfiniteFuture() : absl::FromUnixNanos(ns);
}
inline int64_t ToNanoseconds(absl::Duration duration) {
  return duration >= absl::Nanoseconds(INT64_MAX) ? INT64_MAX : absl::ToInt64Nanoseconds(duration);
}
inline absl::Duration DurationFromNanoseconds(int64_t ns) {
  return ns == INT64_MAX ? absl::InfiniteDuration() : absl::Nanoseconds(ns);
}

}  // namespace sheaf::coordinator
