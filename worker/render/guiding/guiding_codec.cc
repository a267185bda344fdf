// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The bytes of a GuidingField, little-endian: "SHGF", the version as uint32, the box's lower and
// upper corner as doubles, and the tree over space from its root. A node of that is a byte: 1, and
// its two halves follow; or 0, and its region follows: its scattered light as a double and, if that
// is not 0, its share as a float and its quadtree by depth. A node of the quadtree is a byte, whose
// bit q says that quad q is divided further, and four fractions as floats. Indices follow from the
// order, so none can be wrong.
#include <bit>
#include <cmath>
#include <concepts>
#include <limits>
#include <type_traits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "worker/render/guiding/guiding_field.h"

namespace sheaf::render {
namespace {

constexpr std::string_view kMagic = "SHGF";
constexpr uint32_t kVersion = 2;
constexpr uint8_t kIsRegion = 0, kIsHalved = 1;

// Four floats that were rounded from fractions of 1.
constexpr double kSumError = 0x1p-20;

template <typename T>
using BitsOf = std::conditional_t<sizeof(T) == 8, uint64_t, uint32_t>;

template <typename T>
void Put(T value, std::string* out) {
  const auto bits = std::bit_cast<BitsOf<T>>(value);
  for (size_t i = 0; i < sizeof(T); ++i) out->push_back(static_cast<char>(bits >> 8 * i & 0xff));
}

absl::Status Wrong(const std::string& what) {
  return absl::DataLossError(absl::StrCat("the guiding field ", what, "; train it again"));
}

}  // namespace

std::string GuidingField::Encode() const {
  std::string out(kMagic);
  Put(kVersion, &out);
  for (const Vec3d& corner : {lower_, upper_}) {
    for (size_t i = 0; i < 3; ++i) Put(corner[i], &out);
  }
  std::vector<uint32_t> open{0};
  while (!open.empty()) {
    const uint32_t node = space_[open.back()];
    open.pop_back();
    if ((node & kRegionBit) == 0) {
      out.push_back(static_cast<char>(kIsHalved));
      open.push_back(node + 1);
      open.push_back(node);
      continue;
    }
    out.push_back(static_cast<char>(kIsRegion));
    const GuidingRegion& region = regions_[node & ~kRegionBit];
    Put(region.scattered_light_, &out);
    if (!(region.scattered_light_ > 0)) continue;
    Put(region.share_, &out);
    for (const GuidingRegion::Node& quads : region.nodes_) {
      uint32_t divided = 0;
      for (uint32_t q = 0; q < 4; ++q) divided |= (quads.child[q] != 0 ? 1u : 0u) << q;
      out.push_back(static_cast<char>(divided));
      for (const float fraction : quads.fraction) Put(fraction, &out);
    }
  }
  return out;
}

// Reads a field from bytes that may be anything.
class GuidingFieldReader {
 public:
  explicit GuidingFieldReader(std::string_view bytes) : bytes_(bytes) {}

  absl::StatusOr<GuidingField> Read() {
    if (bytes_.size() > kGuidingDirectionsBytesMax) return Wrong("is larger than any");
    if (!bytes_.starts_with(kMagic)) return Wrong("does not begin as one");
    bytes_.remove_prefix(kMagic.size());
    uint32_t version = 0;
    if (!Get(&version)) return Truncated();
    if (version != kVersion) return Wrong(absl::StrCat("has the unknown version ", version));
    Vec3d lower, upper;
    for (Vec3d* corner : {&lower, &upper}) {
      for (size_t i = 0; i < 3; ++i) {
        if (!Get(&(*corner)[i])) return Truncated();
      }
    }
    constexpr double kMax = std::numeric_limits<float>::max();
    for (size_t i = 0; i < 3; ++i) {
      if (!(lower[i] >= -kMax && lower[i] <= upper[i] && upper[i] <= kMax)) {
        return Wrong("has an impossible box");
      }
    }
    GuidingField field(lower, upper);
    if (absl::Status status = ReadSpace(&field, 0, 0); !status.ok()) return status;
    if (!bytes_.empty()) return Wrong("has bytes after its end");
    return field;
  }

 private:
  static absl::Status Truncated() { return Wrong("ends too early (truncated?)"); }

  template <typename T>
  bool Get(T* value) {
    if (bytes_.size() < sizeof(T)) return false;
    BitsOf<T> bits = 0;
    for (size_t i = 0; i < sizeof(T); ++i) {
      bits |= static_cast<BitsOf<T>>(static_cast<uint8_t>(bytes_[i])) << 8 * i;
    }
    *value = std::bit_cast<T>(bits);
    bytes_.remove_prefix(sizeof(T));
    return true;
  }
  bool GetByte(uint8_t* value) {
    if (bytes_.empty()) return false;
    *value = static_cast<uint8_t>(bytes_[0]);
    bytes_.remove_prefix(1);
    return true;
  }

  // Recurses to at most kGuidingSpaceDepthMax.
  absl::Status ReadSpace(GuidingField* field, uint32_t node, int depth) {
    uint8_t kind = 0;
    if (!GetByte(&kind)) return Truncated();
    if (kind == kIsRegion) {
      if (field->regions_.size() >= kGuidingRegionsMax) return Wrong("has too many regions");
      GuidingRegion region;
      if (absl::Status status = ReadRegion(&region); !status.ok()) return status;
      field->SetRegion(node, std::move(region));
      return absl::OkStatus();
    }
    if (kind != kIsHalved) return Wrong("has a damaged tree of regions");
    if (depth >= kGuidingSpaceDepthMax) return Wrong("has a tree of regions that is too deep");
    const uint32_t first = field->Halve(node);
    for (const uint32_t half : {first, first + 1}) {
      if (absl::Status status = ReadSpace(field, half, depth + 1); !status.ok()) return status;
    }
    return absl::OkStatus();
  }

  absl::Status ReadRegion(GuidingRegion* region) {
    if (!Get(&region->scattered_light_)) return Truncated();
    if (!std::isfinite(region->scattered_light_) || std::signbit(region->scattered_light_)) {
      return Wrong("has light that is negative or not finite");
    }
    if (region->scattered_light_ > 0) {
      if (!Get(&region->share_)) return Truncated();
      if (!(region->share_ >= kGuidedShareMin && region->share_ <= kGuidedShareMax)) {
        return Wrong("has an impossible share of directions");
      }
      if (absl::Status status = ReadQuads(region); !status.ok()) return status;
    }
    quad_count_ += 4 * region->nodes_.size();
    if (quad_count_ > kGuidingQuadsMax) return Wrong("has too many directions");
    return absl::OkStatus();
  }

  absl::Status ReadQuads(GuidingRegion* region) {
    // The density of each node's square against the uniform one, and its depth.
    struct Square {
      double density;
      int depth;
    };
    std::vector<Square> squares{{1, 0}};
    region->nodes_.clear();
    for (size_t i = 0; i < squares.size(); ++i) {
      const Square square = squares[i];
      GuidingRegion::Node node;
      uint8_t divided = 0;
      if (!GetByte(&divided)) return Truncated();
      if (divided > 0xf) return Wrong("has a damaged tree of directions");
      double sum = 0;
      for (uint32_t q = 0; q < 4; ++q) {
        if (!Get(&node.fraction[q])) return Truncated();
        const double fraction = static_cast<double>(node.fraction[q]);
        sum += fraction;
        // Holds for NaN too. The error of each depth is at most kSumError.
        const double density = 4 * fraction * square.density;
        if (!(density >= kGuidingUniformShare * (1 - 16 * kSumError))) {
          return Wrong("has a direction without density");
        }
        if ((divided >> q & 1) == 0) continue;
        if (square.depth + 1 >= kGuidingQuadDepthMax ||
            squares.size() >= kGuidingNodesInRegionMax) {
          return Wrong("has a tree of directions that is too large");
        }
        node.child[q] = static_cast<uint16_t>(squares.size());
        squares.push_back({density, square.depth + 1});
      }
      if (!(std::fabs(sum - 1) <= kSumError)) return Wrong("has fractions that do not sum to 1");
      region->nodes_.push_back(node);
    }
    region->nodes_.shrink_to_fit();
    return absl::OkStatus();
  }

  std::string_view bytes_;
  size_t quad_count_ = 0;
};

absl::StatusOr<GuidingField> GuidingField::Decode(std::string_view bytes) {
  return GuidingFieldReader(bytes).Read();
}

}  // namespace sheaf::render
