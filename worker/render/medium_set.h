// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MediumSet: the media a path is in. A multiset: what has been entered twice is left twice, and
// counts twice meanwhile, so that volumes that overlap add up and the order in which they are
// entered and left does not matter. See docs/adr/0018.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

namespace sheaf::render {

// Media that one path can be in at once; a path that enters more ends and is counted. With their
// number they fill a cache line, and the densities of all of them have numbers of 8 bits.
inline constexpr uint32_t kMediaAtOnceMax = 30;
// Media of a scene: an index is two bytes.
inline constexpr uint32_t kMediaMax = 1u << 16;
// Of surfaces that bound no matter with a priority, and of no matter.
inline constexpr uint16_t kNoRank = 0xffff;

class MediumSet {
 public:
  bool empty() const { return count_ == 0; }
  uint32_t size() const { return count_; }
  // In ascending order.
  const uint16_t* begin() const { return media_.data(); }
  const uint16_t* end() const { return media_.data() + count_; }

  friend bool operator==(const MediumSet& a, const MediumSet& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end());
  }

  // False where the set is full.
  [[nodiscard]] bool Add(uint16_t medium) {
    if (count_ == kMediaAtOnceMax) return false;
    uint32_t at = count_++;
    for (; at > 0 && media_[at - 1] > medium; --at) media_[at] = media_[at - 1];
    media_[at] = medium;
    return true;
  }
  // Takes one away; false where there is none.
  [[nodiscard]] bool Remove(uint16_t medium) {
    uint32_t at = 0;
    while (at < count_ && media_[at] != medium) ++at;
    if (at == count_) return false;
    for (--count_; at < count_; ++at) media_[at] = media_[at + 1];
    return true;
  }

 private:
  uint32_t count_ = 0;
  std::array<uint16_t, kMediaAtOnceMax> media_{};
};

}  // namespace sheaf::render
