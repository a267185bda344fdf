// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The bytes of an EmissionField, little-endian: "SHEF"; version and number of lights as uint32; the
// nodes of the tree from its root, each before its lower and then its upper part. A node is a byte,
// EmissionField::Kind. If it is divided, the first light of its upper part follows as uint32, or 0
// for an axis, and the share of its lower part as a float.
#include "worker/render/guiding/emission_field.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/vector_bytes.h"

namespace sheaf::render {
namespace {

constexpr std::string_view kEmissionMagic = "SHEF";
constexpr uint32_t kEmissionVersion = 1;

void AppendUint32(uint32_t word, std::string* bytes) {
  for (int i = 0; i < 4; ++i) bytes->push_back(static_cast<char>(word >> 8 * i & 0xff));
}
// Takes the first four bytes. Requires: at least four are left.
uint32_t TakeUint32(std::string_view* bytes) {
  uint32_t word = 0;
  for (size_t i = 0; i < 4; ++i) {
    word |= static_cast<uint32_t>(static_cast<uint8_t>((*bytes)[i])) << 8 * i;
  }
  bytes->remove_prefix(4);
  return word;
}

absl::Status WrongEmission(const std::string& what) {
  return absl::DataLossError(absl::StrCat("the field of emission ", what, "; train it again"));
}

// A part of the tree that is still to be read.
struct Part {
  uint32_t first = 0, last = 0;
  std::array<uint32_t, kEmissionAxes> halvings{};
  uint32_t parent = 0;
  bool is_upper = false;
};

}  // namespace

EmissionPlace EmissionField::Cell::PlaceAt(const EmissionPlace& u) const {
  EmissionPlace place;
  for (size_t axis = 0; axis < kEmissionAxes; ++axis) {
    place.u[axis] = lower[axis] + size[axis] * u.u[axis];
  }
  return place;
}

uint32_t EmissionField::Enter(uint32_t index, bool is_upper, Cell* cell) const {
  const Node& node = nodes_[index];
  const auto share = static_cast<double>(node.lower_share);
  cell->density *= is_upper ? 1 - share : share;
  if (node.kind == static_cast<uint8_t>(Kind::kByLight)) {
    (is_upper ? cell->first : cell->last) = node.light;
  } else {
    const size_t axis = node.kind - size_t{1};
    cell->density *= 2;
    cell->size[axis] *= 0.5;
    if (is_upper) cell->lower[axis] += cell->size[axis];
  }
  return is_upper ? node.upper : index + 1;
}

EmissionField::Cell EmissionField::Sample(double* v) const {
  Cell cell;
  cell.last = light_count_;
  for (uint32_t index = 0; nodes_[index].kind != 0;) {
    const auto share = static_cast<double>(nodes_[index].lower_share);
    const bool is_upper = *v >= share;
    *v = std::clamp(is_upper ? (*v - share) / (1 - share) : *v / share, 0.0, kPlaceMost);
    index = Enter(index, is_upper, &cell);
  }
  return cell;
}

EmissionField::Cell EmissionField::CellOf(uint32_t light, const EmissionPlace& place) const {
  Cell cell;
  cell.last = light_count_;
  for (uint32_t index = 0; nodes_[index].kind != 0;) {
    const Node& node = nodes_[index];
    bool is_upper = light >= node.light;
    if (node.kind != static_cast<uint8_t>(Kind::kByLight)) {
      const size_t axis = node.kind - size_t{1};
      is_upper = place.u[axis] >= cell.lower[axis] + 0.5 * cell.size[axis];
    }
    index = Enter(index, is_upper, &cell);
  }
  return cell;
}

uint64_t EmissionField::memory_bytes() const { return sizeof(*this) + VectorBytes(nodes_); }

std::string EmissionField::Encode() const {
  std::string bytes(kEmissionMagic);
  AppendUint32(kEmissionVersion, &bytes);
  AppendUint32(light_count_, &bytes);
  for (const Node& node : nodes_) {
    bytes.push_back(static_cast<char>(node.kind));
    if (node.kind == 0) continue;
    AppendUint32(node.light, &bytes);
    AppendUint32(std::bit_cast<uint32_t>(node.lower_share), &bytes);
  }
  return bytes;
}

absl::StatusOr<EmissionField> EmissionField::Decode(std::string_view bytes, uint32_t light_count) {
  if (bytes.size() <= kEmissionHeaderBytes || bytes.size() > kEmissionBytesMax) {
    return WrongEmission("has an impossible size");
  }
  if (!bytes.starts_with(kEmissionMagic)) return WrongEmission("does not begin as one");
  bytes.remove_prefix(kEmissionMagic.size());
  if (const uint32_t version = TakeUint32(&bytes); version != kEmissionVersion) {
    return WrongEmission(absl::StrCat("has the unknown version ", version));
  }
  EmissionField field;
  field.light_count_ = TakeUint32(&bytes);
  if (field.light_count_ != light_count || light_count == 0) {
    return WrongEmission("is that of other lights");
  }
  std::vector<Part> open{{0, light_count, {}, 0, false}};
  while (!open.empty()) {
    Part part = open.back();
    open.pop_back();
    if (bytes.empty()) return WrongEmission("ends too early");
    const auto index = static_cast<uint32_t>(field.nodes_.size());
    if (part.is_upper) field.nodes_[part.parent].upper = index;
    Node& node = field.nodes_.emplace_back();
    node.kind = static_cast<uint8_t>(bytes[0]);
    bytes.remove_prefix(1);
    if (node.kind == 0) continue;
    if (node.kind > static_cast<uint8_t>(Kind::kByLight) || bytes.size() < 8) {
      return WrongEmission("has an impossible node");
    }
    node.light = TakeUint32(&bytes);
    node.lower_share = std::bit_cast<float>(TakeUint32(&bytes));
    if (!(node.lower_share >= 0 && node.lower_share <= 1)) {
      return WrongEmission("has an impossible probability");
    }
    const bool by_light = node.kind == static_cast<uint8_t>(Kind::kByLight);
    Part lower = part, upper = part;
    if (by_light) {
      if (!(part.first < node.light && node.light < part.last)) {
        return WrongEmission("has an impossible node");
      }
      lower.last = upper.first = node.light;
    } else {
      const size_t axis = node.kind - size_t{1};
      if (part.last - part.first != 1 || part.halvings[axis] == kEmissionHalvingsMax ||
          node.light != 0) {
        return WrongEmission("has an impossible node");
      }
      ++lower.halvings[axis];
      ++upper.halvings[axis];
    }
    lower.is_upper = false;
    upper.is_upper = true;
    upper.parent = index;
    open.push_back(upper);
    open.push_back(lower);
  }
  if (!bytes.empty()) return WrongEmission("is followed by other bytes");
  if (field.cell_count() > kEmissionCellsMax) return WrongEmission("has too many cells");
  return field;
}

}  // namespace sheaf::render
