// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Slot: the numbers of a vertex that a mesh has, and the names of PLY properties that give them.
#pragma once

#include <string>
#include <string_view>

namespace sheaf {

// Role of a vertex property in a mesh; kSkipped if it has none.
enum Slot { kX, kY, kZ, kNormalX, kNormalY, kNormalZ, kU, kV, kSlotCount, kSkipped = kSlotCount };

inline Slot SlotOf(const std::string& name) {
  struct SlotName {
    std::string_view name;
    Slot slot;
  };
  static constexpr SlotName kNames[] = {
      {"x", kX},         {"y", kY},         {"z", kZ},         {"nx", kNormalX},  {"ny", kNormalY},
      {"nz", kNormalZ},  {"u", kU},         {"v", kV},         {"s", kU},         {"t", kV},
      {"texture_u", kU}, {"texture_v", kV}, {"texture_s", kU}, {"texture_t", kV},
  };
  for (const SlotName& entry : kNames) {
    if (entry.name == name) return entry.slot;
  }
  return kSkipped;
}

}  // namespace sheaf
