// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FramesByDigest: the live frames that a result may belong to. A digest has one frame but where
// somebody submits the same again, so those beyond the first are kept apart.
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
  // Nothing happens where it is not there.
  void Erase(const PackedDigest& digest, const FrameId& id);
  // Ascending. May hold frames of other digests, by chance.
  std::vector<FrameId> Find(const PackedDigest& digest) const;

 private:
  absl::flat_hash_map<uint64_t, FrameId> first_;  // By the digest's hash.
  std::map<uint64_t, std::set<FrameId>> others_;
};

}  // namespace sheaf::coordinator
