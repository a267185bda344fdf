// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CacheShortage: by how much a scene does not fit into a content cache. It travels with the status
// of ContentCache::Acquire.
#pragma once

#include <cstdint>
#include <optional>

#include "absl/status/status.h"

namespace sheaf {

struct CacheShortage {
  uint64_t needed_bytes = 0;  // Of the scene's files, all together; 0: there is no shortage.
  uint64_t room_bytes = 0;    // That the cache could give to them.
  friend bool operator==(const CacheShortage&, const CacheShortage&) = default;
};

// The status, which must be an error, with the shortage.
absl::Status WithShortage(absl::Status status, const CacheShortage& shortage);
std::optional<CacheShortage> ShortageOf(const absl::Status& status);

}  // namespace sheaf
