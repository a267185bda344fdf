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
#include <optional>
#include <tuple>

namespace sheaf::render {

// Media that one path can be in at once; a path that enters more ends and is counted. With their
// number they fill a cache line, and the densities of all of them have numbers of 8 bits.
inline constexpr uint32_t kMediaAtOnceMax = 30;
// Media of a scene: an index is two bytes.
inline constexpr uint32_t kMediaMax = 1u << 16;

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

  bool Contains(uint16_t medium) const { return std::find(begin(), end(), medium) != end(); }
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

// The media that a surface names for its sides; nothing where there is no medium. The front is what
// a scene file calls outside.
struct MediumSides {
  std::optional<uint16_t> back, front;
};
enum class Nesting : uint8_t {
  kRight,
  kContradicted,  // The path cannot have been in *set on the side it came from.
  kFull,          // Of media: the path ends.
};
// Changes *set, of a path that meets a surface on one side and goes on from the other, or from the
// same. Where the surface contradicts the set, what it says of the side that the path goes on from
// counts, and nothing else does: that is how pbrt-v4 takes a ray's medium, always. A side without a
// medium contradicts nothing, as media add up; but a surface that has one in front only, and is met
// from behind by a path in it, is the wrong way round. See docs/adr/0051.
inline Nesting MeetSides(const MediumSides& sides, bool from_front, bool to_front, MediumSet* set) {
  const std::optional<uint16_t>& from = from_front ? sides.front : sides.back;
  const std::optional<uint16_t>& to = to_front ? sides.front : sides.back;
  const bool contradicts = from.has_value()
                               ? !set->Contains(*from)
                               : !from_front && sides.front && set->Contains(*sides.front);
  if (contradicts) {
    *set = {};
  } else {
    if (from_front == to_front) return Nesting::kRight;
    if (from.has_value()) std::ignore = set->Remove(*from);
  }
  if (to.has_value() && !set->Add(*to)) return Nesting::kFull;
  return contradicts ? Nesting::kContradicted : Nesting::kRight;
}

}  // namespace sheaf::render
