// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Slot: the numbers of a vertex that a mesh has, and the names of PLY properties that give them.
#pragma once

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "common/scene/formats/ply_header.h"

namespace sheaf {

// Role of a vertex property in a mesh; kSkipped if it has none.
enum Slot {
  kX,
  kY,
  kZ,
  kNormalX,
  kNormalY,
  kNormalZ,
  kU,
  kV,
  kRed,
  kGreen,
  kBlue,
  kAlpha,
  kSlotCount,
  kSkipped = kSlotCount
};
inline constexpr const char* kSlotNames[] = {"x", "y", "z",   "nx",    "ny",   "nz",
                                             "u", "v", "red", "green", "blue", "alpha"};

inline Slot SlotOf(const std::string& name) {
  struct SlotName {
    std::string_view name;
    Slot slot;
  };
  static constexpr SlotName kNames[] = {
      {"x", kX},         {"y", kY},         {"z", kZ},         {"nx", kNormalX},  {"ny", kNormalY},
      {"nz", kNormalZ},  {"u", kU},         {"v", kV},         {"s", kU},         {"t", kV},
      {"texture_u", kU}, {"texture_v", kV}, {"texture_s", kU}, {"texture_t", kV}, {"red", kRed},
      {"green", kGreen}, {"blue", kBlue},   {"alpha", kAlpha},
  };
  for (const SlotName& entry : kNames) {
    if (entry.name == name) return entry.slot;
  }
  return kSkipped;
}

// The slots of a vertex' properties; *has: which of them are filled. If two properties fill one,
// the first one counts. Colors are floats.
inline std::vector<Slot> SlotsOf(const std::vector<PlyProperty>& properties, bool reads_colors,
                                 std::array<bool, kSlotCount + 1>* has) {
  std::vector<Slot> slots;
  for (const PlyProperty& property : properties) {
    Slot slot = property.is_list ? kSkipped : SlotOf(property.name);
    const bool is_color = slot >= kRed && slot <= kAlpha;
    const bool is_read = !is_color || (reads_colors && property.type == PlyType::kFloat32);
    if ((*has)[slot] || !is_read) slot = kSkipped;
    (*has)[slot] = true;
    slots.push_back(slot);
  }
  return slots;
}

// Whether each property is a float, and there are few.
inline bool AreFloats(const std::vector<PlyProperty>& properties) {
  return properties.size() <= kSlotCount &&
         std::ranges::all_of(properties, [](const PlyProperty& property) {
           return !property.is_list && property.type == PlyType::kFloat32;
         });
}

}  // namespace sheaf
