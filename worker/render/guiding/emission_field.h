// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EmissionField: what a training has learned about the light paths that reach the picture: a
// density over the lights and over the places of their rays (emission_place.h), constant in each
// cell. The cells are the leaves of a binary tree. It first tells lights apart, by their numbers;
// a part with one light is halved along the axes of its places. Immutable.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "worker/render/light/emission_place.h"

namespace sheaf::render {

inline constexpr uint32_t kEmissionCellsMax = uint32_t{1} << 16;
// Along one axis: cells are no finer than 2^-12 of it.
inline constexpr uint32_t kEmissionHalvingsMax = 12;
// Sizes in an encoded field: a byte for a cell, nine for a node that is divided.
inline constexpr size_t kEmissionHeaderBytes = 3 * sizeof(uint32_t);
inline constexpr size_t kEmissionBytesMax = kEmissionHeaderBytes + 10 * size_t{kEmissionCellsMax};

class EmissionField {
 public:
  // Lights [first, last), and a box of places if that is one light.
  struct Cell {
    uint32_t first = 0, last = 0;
    std::array<double, kEmissionAxes> lower{0, 0, 0, 0}, size{1, 1, 1, 1};
    // The probability of the cell over the volume of the box.
    double density = 1;

    // The place in the box that numbers in [0, 1) give.
    EmissionPlace PlaceAt(const EmissionPlace& u) const;
  };

  // Knows nothing.
  EmissionField() = default;
  bool empty() const { return nodes_.empty(); }

  // The cell that v, in [0, 1), chooses; *v becomes a number in [0, 1) that is independent of the
  // choice. Requires: !empty().
  Cell Sample(double* v) const;
  // The cell of the light and the place, without its box. Requires: !empty(), light <
  // light_count().
  Cell CellOf(uint32_t light, const EmissionPlace& place) const;
  uint32_t light_count() const { return light_count_; }
  uint32_t cell_count() const { return static_cast<uint32_t>(nodes_.size() / 2 + 1); }
  uint64_t memory_bytes() const;

  // At most kEmissionBytesMax.
  std::string Encode() const;
  // light_count: LightEmission::choice_count(). Errors: kDataLoss for other bytes than those of
  // Encode.
  static absl::StatusOr<EmissionField> Decode(std::string_view bytes, uint32_t light_count);

 private:
  friend class EmissionFit;

  enum class Kind : uint8_t {
    kCell = 0,
    kHalved = 1,  // Plus the axis.
    kByLight = 1 + kEmissionAxes,
  };
  // A node's lower part follows it.
  struct Node {
    uint8_t kind = 0;
    uint32_t upper = 0;       // Index of the upper part.
    uint32_t light = 0;       // kByLight: the first light of the upper part.
    float lower_share = 0.5;  // The probability of the lower part, in that of the node.
  };
  // Goes on with a part of the node: narrows the cell, and returns the part's index.
  uint32_t Enter(uint32_t index, bool is_upper, Cell* cell) const;

  uint32_t light_count_ = 0;
  std::vector<Node> nodes_;
};

}  // namespace sheaf::render
