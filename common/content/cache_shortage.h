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
  uint64_t needed_bytes = 0;  // All files of the scene; 0: there is no shortage.
  uint64_t room_bytes = 0;    // Available to them in the cache.
  friend bool operator==(const CacheShortage&, const CacheShortage&) = default;
};

// The status, which must be an error, with the shortage.
absl::Status WithShortage(absl::Status status, const CacheShortage& shortage);
std::optional<CacheShortage> ShortageOf(const absl::Status& status);

}  // namespace sheaf
