// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/frames_by_digest.h"

#include <algorithm>

namespace sheaf::coordinator {

void FramesByDigest::Insert(const PackedDigest& digest, const FrameId& id) {
  const auto [found, is_new] = first_.try_emplace(digest.Hash(), id);
  if (!is_new && found->second != id) others_[digest.Hash()].insert(id);
}

void FramesByDigest::Erase(const PackedDigest& digest, const FrameId& id) {
  const auto others = others_.find(digest.Hash());
  const auto first = first_.find(digest.Hash());
  if (first == first_.end()) return;
  if (first->second != id) {
    if (others != others_.end()) others->second.erase(id);
  } else if (others == others_.end()) {
    first_.erase(first);
  } else {
    first->second = *others->second.begin();
    others->second.erase(others->second.begin());
  }
  if (others != others_.end() && others->second.empty()) others_.erase(others);
}

std::vector<FrameId> FramesByDigest::Find(const PackedDigest& digest) const {
  const auto first = first_.find(digest.Hash());
  if (first == first_.end()) return {};
  std::vector<FrameId> frames{first->second};
  if (const auto others = others_.find(digest.Hash()); others != others_.end()) {
    frames.insert(frames.end(), others->second.begin(), others->second.end());
    std::ranges::sort(frames);
  }
  return frames;
}

}  // namespace sheaf::coordinator
