// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/job/requirements.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "common/base/label.h"

namespace sheaf::coordinator {
namespace {

absl::Status CheckNames(const std::string& pool, const std::vector<std::string>& tags,
                        size_t tags_max) {
  if (const std::string why = WhyNoLabel(pool); !why.empty()) {
    return absl::InvalidArgumentError(absl::StrCat("pool: ", why));
  }
  if (tags.size() > tags_max) {
    return absl::InvalidArgumentError(
        absl::StrCat("tags: ", tags.size(), " are more than ", tags_max));
  }
  for (const std::string& tag : tags) {
    const std::string why = WhyNoLabel(tag);
    if (!why.empty()) return absl::InvalidArgumentError(absl::StrCat("tags: ", why));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckRequirements(const Requirements& requirements) {
  return CheckNames(requirements.pool, requirements.tags, kJobTagsMax);
}

absl::Status CheckWorkerTraits(const WorkerTraits& traits) {
  return CheckNames(traits.pool, traits.tags, kWorkerTagsMax);
}

std::vector<std::string> SortedTags(std::vector<std::string> tags) {
  std::sort(tags.begin(), tags.end());
  tags.erase(std::unique(tags.begin(), tags.end()), tags.end());
  return tags;
}

std::string FormatTags(const std::vector<std::string>& tags) { return absl::StrJoin(tags, " "); }

std::vector<std::string> ParseTags(const std::string& text) {
  return SortedTags(absl::StrSplit(text, ' ', absl::SkipEmpty()));
}

uint64_t RoundMemoryUp(uint64_t bytes) {
  if (bytes == 0) return 0;
  const uint64_t step = std::max<uint64_t>(1, std::bit_floor(bytes) / 4);
  const uint64_t rest = bytes % step;
  return rest == 0 || bytes > UINT64_MAX - step ? bytes : bytes - rest + step;
}

}  // namespace sheaf::coordinator
