// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FramesByDigest: the live frames that a result may belong to. A digest usually has one frame; it
// has several if the same frame is submitted again. Those beyond the first are stored apart.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "coordinator/scheduling/packed_frame.h"

namespace sheaf::coordinator {

class FramesByDigest {
 public:
  void Insert(const PackedDigest& digest, const FrameId& id);
  // A no-op if it is absent.
  void Erase(const PackedDigest& digest, const FrameId& id);
  // Ascending. May include frames of other digests (hash collisions).
  std::vector<FrameId> Find(const PackedDigest& digest) const;

 private:
  absl::flat_hash_map<uint64_t, FrameId> first_;  // By the digest's hash.
  std::map<uint64_t, std::set<FrameId>> others_;
};

}  // namespace sheaf::coordinator
