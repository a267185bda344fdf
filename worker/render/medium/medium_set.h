// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MediumSet: the media that a path is in. A multiset: a medium that is entered twice must be left
// twice and counts twice in between, so that overlapping volumes add up and the order of entering
// and leaving does not matter. See docs/adr/0018.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <tuple>

namespace sheaf::render {

// Maximum number of media that a path can be in; a path that enters more ends and is counted. The
// set fills a cache line, and the densities of all its media have 8-bit numbers.
inline constexpr uint32_t kMediaAtOnceMax = 30;
// Maximum number of media of a scene: an index has two bytes.
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
  // Returns false if the set is full.
  [[nodiscard]] bool Add(uint16_t medium) {
    if (count_ == kMediaAtOnceMax) return false;
    uint32_t at = count_++;
    for (; at > 0 && media_[at - 1] > medium; --at) media_[at] = media_[at - 1];
    media_[at] = medium;
    return true;
  }
  // Removes one instance; returns false if there is none.
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

// The media that a surface specifies for its sides, if any. The front is the outside in a scene
// file.
struct MediumSides {
  std::optional<uint16_t> back, front;
};
enum class Nesting : uint8_t {
  kRight,
  kContradicted,  // The path cannot have been in *set on the side it came from.
  kFull,          // The set is full: the path ends.
};
// Updates *set for a path that arrives at one side of a surface and continues from the other or the
// same side. Where the surface contradicts the set, only the surface's medium on the side where the
// path continues counts, as pbrt-v4 always does. A side without a medium contradicts nothing,
// because media add up; but a surface with a medium in front only that a path hits from behind,
// while in that medium, is oriented wrongly. See docs/adr/0051.
inline Nesting CrossSides(const MediumSides& sides, bool from_front, bool to_front,
                          MediumSet* set) {
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
