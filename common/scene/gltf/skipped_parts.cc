// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/skipped_parts.h"

#include "absl/strings/str_cat.h"
#include "common/scene/gltf/values.h"

namespace sheaf::gltf {

void SkippedParts::Add(const std::string& what, const std::string& problem) {
  const auto [entry, is_new] = index_of_.try_emplace(problem, kinds_.size());
  if (is_new) kinds_.push_back({problem, what, 0});
  ++kinds_[entry->second].count;
}

void SkippedParts::Report(Diagnostics* diagnostics) const {
  for (const Kind& kind : kinds_) {
    const uint64_t others = kind.count - 1;
    diagnostics->Note(kFile, absl::StrCat(kind.first, others > 0 ? ", and " : "",
                                          others > 0 ? absl::StrCat(others) : "",
                                          others == 1  ? " other"
                                          : others > 1 ? " others"
                                                       : "",
                                          ": ", kind.problem));
  }
}

}  // namespace sheaf::gltf
