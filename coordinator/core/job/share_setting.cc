// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/job/share_setting.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/label.h"
#include "common/base/printable.h"

namespace sheaf::coordinator {
namespace {

constexpr std::pair<ShareKind, const char*> kKindNames[] = {
    {ShareKind::kUser, "user"}, {ShareKind::kShow, "show"}, {ShareKind::kPool, "pool"}};

}  // namespace

std::string FormatShareSubject(const ShareSubject& subject) {
  for (const auto& [kind, name] : kKindNames) {
    if (kind == subject.kind) return absl::StrCat(name, ":", subject.name);
  }
  return subject.name;
}

absl::StatusOr<ShareSubject> ParseShareSubject(const std::string& text) {
  for (const auto& [kind, name] : kKindNames) {
    const std::string prefix = absl::StrCat(name, ":");
    if (!text.starts_with(prefix)) continue;
    ShareSubject subject{kind, text.substr(prefix.size())};
    const std::string why = WhyNoLabel(subject.name);
    if (!why.empty()) return absl::InvalidArgumentError(absl::StrCat(name, ": the name ", why));
    return subject;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("\"", Printable(text.substr(0, kLabelBytesMax)),
                   "\" names nothing that has a share; give user:NAME, show:NAME or pool:NAME"));
}

absl::Status CheckShareSetting(const ShareSubject& subject, const ShareSetting& setting) {
  // Written so that NaN is refused too.
  if (!(setting.weight >= kShareWeightMin && setting.weight <= kShareWeightMax)) {
    return absl::InvalidArgumentError(absl::StrCat("weight: ", setting.weight, " is outside ",
                                                   kShareWeightMin, " to ", kShareWeightMax));
  }
  if (subject.kind == ShareKind::kPool && setting.weight != 1) {
    return absl::InvalidArgumentError(
        "weight: a pool has none, only --threads-max; work is shared between shows and users");
  }
  if (setting.threads_max < 0 || setting.threads_max > kShareThreadsMax) {
    return absl::InvalidArgumentError(absl::StrCat(
        "threads_max: ", setting.threads_max, " is outside 0 (no limit) to ", kShareThreadsMax));
  }
  return absl::OkStatus();
}

}  // namespace sheaf::coordinator
