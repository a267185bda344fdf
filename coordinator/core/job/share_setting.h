// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ShareSetting: an operator's setting for a user, a show or a pool: its share of the farm relative
// to others, and the threads that it may hold.
#pragma once

#include <compare>
#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace sheaf::coordinator {

inline constexpr char kDefaultShow[] = "default";
inline constexpr double kShareWeightMin = 0.001, kShareWeightMax = 1000;
inline constexpr int32_t kShareThreadsMax = 100'000'000;

// Stored as numbers: append new ones.
enum class ShareKind { kUser, kShow, kPool };

struct ShareSubject {
  ShareKind kind = ShareKind::kUser;
  std::string name;  // A label (common/base/label.h).
  friend auto operator<=>(const ShareSubject&, const ShareSubject&) = default;
};
// "user:anna", "show:comet" or "pool:gpu".
std::string FormatShareSubject(const ShareSubject& subject);
// Errors: kInvalidArgument.
absl::StatusOr<ShareSubject> ParseShareSubject(const std::string& text);

struct ShareSetting {
  double weight = 1;        // A user's relative to users of the show; a show's to shows.
  int32_t threads_max = 0;  // 0: no limit.
  friend bool operator==(const ShareSetting&, const ShareSetting&) = default;
};
// A pool's weight is always 1. Errors: kInvalidArgument.
absl::Status CheckShareSetting(const ShareSubject& subject, const ShareSetting& setting);

}  // namespace sheaf::coordinator
