// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ShareSetting: what an operator has set for a user, a show or a pool: how much of the farm it gets
// beside others, and how many threads it may hold.
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

// Stored as numbers: new ones go to the end.
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
  double weight = 1;        // Of a user beside those of the same show, or a show beside others.
  int32_t threads_max = 0;  // 0: no limit.
  friend bool operator==(const ShareSetting&, const ShareSetting&) = default;
};
// Pools have no weight but 1. Errors: kInvalidArgument.
absl::Status CheckShareSetting(const ShareSubject& subject, const ShareSetting& setting);

}  // namespace sheaf::coordinator
