// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/guiding/guiding_statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

#include "common/base/check.h"
#include "common/base/vector_bytes.h"
#include "common/math/elementary.h"

namespace sheaf::render {
namespace {

constexpr auto kRelaxed = std::memory_order_relaxed;

// Regions without light do not stand in the way of the limits, however few quads the others have.
static_assert(kGuidingRegionsMax * 4 * ((1u << 2 * kGuidingStartDepth) - 1) / 3 <=
              kGuidingQuadsMax);

// More iterations than any training has.
constexpr int kIterationMax = 60;

double SplitValues(int iteration) {
  constexpr double kSqrtTwo = 0x1.6a09e667f3bcdp+0;
  const int k = std::clamp(iteration, 0, kIterationMax);
  return kGuidingSplitValues * elementary::PowerOfTwo(k / 2) * (k % 2 == 1 ? kSqrtTwo : 1.0);
}

}  // namespace

GuidingStatistics::GuidingStatistics(const GuidingField& field, int unit_exponent)
    : field_(field), numbers_(field.regions_.size() * kParts) {
  SHEAF_CHECK(std::abs(unit_exponent) <= kGuidingUnitExponentMax);
  units_per_value_ = elementary::PowerOfTwo(-unit_exponent);
  value_of_unit_ = elementary::PowerOfTwo(unit_exponent);
  size_t quads = 0;
  for (const GuidingRegion& region : field.regions_) {
    first_quad_.push_back(quads);
    quads += 4 * region.nodes_.size();
  }
  sums_ = std::vector<std::atomic<uint64_t>>(quads);
}

void GuidingStatistics::Add(Vec3f p, Vec3f w, double value) {
  const GuidingField::Place place = field_.PlaceOf(p);
  size_t part = 0;
  for (int i = 0; i < GuidingField::kHalvingsCounted; ++i) {
    part = 2 * part + field_.HalfOf(place, place.depth + i);
  }
  numbers_[place.region * kParts + part].fetch_add(1, kRelaxed);
  if (!std::isfinite(value)) {
    non_finite_.fetch_add(1, kRelaxed);
    return;
  }
  double units = value * units_per_value_;
  if (units > kGuidingValueMax) {
    clamped_.fetch_add(1, kRelaxed);
    units = kGuidingValueMax;
  }
  if (!(units >= 0.5)) return;  // Rounds to 0.
  sums_[first_quad_[place.region] + field_.regions_[place.region].QuadOf(w)].fetch_add(
      static_cast<uint64_t>(units + 0.5), kRelaxed);
}

uint64_t GuidingStatistics::memory_bytes() const {
  return sizeof(*this) + VectorBytes(first_quad_, sums_, numbers_);
}

// One call of Refine. Sums become doubles, which are added in the order of the nodes: the same bits
// everywhere.
class GuidingRefinement {
 public:
  GuidingRefinement(const GuidingField& field, const GuidingStatistics& statistics)
      : old_(field), statistics_(statistics), regions_(field.regions_.size()) {
    for (size_t r = 0; r < regions_.size(); ++r) Load(r);
    LoadDepths(0, 0);
  }

  GuidingField Make(int iteration) {
    double values = SplitValues(iteration);
    while (!ChooseHalvings(values)) values *= kGuidingThresholdGrowth;
    double fraction = kGuidingQuadFraction;
    while (!MakeQuadtrees(fraction)) fraction *= kGuidingThresholdGrowth;
    GuidingField field(old_.lower_, old_.upper_);
    Copy(0, 0, values, &field);
    return field;
  }

 private:
  static constexpr size_t kParts = GuidingStatistics::kParts;
  using Nodes = std::vector<GuidingRegion::Node>;

  struct Region {
    std::vector<std::array<double, 4>> weights;  // [node][quad]: sums, of the nodes below too.
    double total = 0;
    std::array<double, kParts + 1> numbers_before{};  // Values in all parts before this one.
    int depth = 0;
    size_t copies = 1;  // Regions that take its place.
    GuidingRegion refined;
  };
  // Parts [begin, end) of a region, at some depth in the tree over space.
  struct Parts {
    size_t begin = 0, end = kParts;
    int depth = 0;
  };

  void Load(size_t r) {
    const Nodes& nodes = old_.regions_[r].nodes_;
    Region& region = regions_[r];
    region.weights.resize(nodes.size());
    const auto sum_of = [](const std::array<double, 4>& w) { return w[0] + w[1] + w[2] + w[3]; };
    for (size_t i = nodes.size(); i-- > 0;) {
      for (size_t q = 0; q < 4; ++q) {
        const size_t child = nodes[i].child[q];
        const size_t quad = statistics_.first_quad_[r] + 4 * i + q;
        region.weights[i][q] = child != 0
                                   ? sum_of(region.weights[child])
                                   : static_cast<double>(statistics_.sums_[quad].load(kRelaxed));
      }
    }
    region.total = sum_of(region.weights[0]);
    for (size_t part = 0; part < kParts; ++part) {
      const uint64_t number = statistics_.numbers_[r * kParts + part].load(kRelaxed);
      region.numbers_before[part + 1] = region.numbers_before[part] + static_cast<double>(number);
    }
  }

  void LoadDepths(uint32_t index, int depth) {
    const uint32_t node = old_.space_[index];
    if ((node & GuidingField::kRegionBit) != 0) {
      regions_[node & ~GuidingField::kRegionBit].depth = depth;
      return;
    }
    LoadDepths(node, depth + 1);
    LoadDepths(node + 1, depth + 1);
  }

  static bool IsHalved(const Region& region, const Parts& parts, double values) {
    return region.numbers_before[parts.end] - region.numbers_before[parts.begin] > values &&
           parts.end - parts.begin > 1 && parts.depth < kGuidingSpaceDepthMax;
  }
  static Parts HalfOf(const Parts& parts, int half) {
    const size_t middle = (parts.begin + parts.end) / 2;
    return half == 0 ? Parts{parts.begin, middle, parts.depth + 1}
                     : Parts{middle, parts.end, parts.depth + 1};
  }
  static size_t CopiesOf(const Region& region, const Parts& parts, double values) {
    if (!IsHalved(region, parts, values)) return 1;
    return CopiesOf(region, HalfOf(parts, 0), values) + CopiesOf(region, HalfOf(parts, 1), values);
  }

  // False if there are too many regions.
  bool ChooseHalvings(double values) {
    size_t count = 0;
    for (Region& region : regions_) {
      region.copies = CopiesOf(region, {0, kParts, region.depth}, values);
      count += region.copies;
    }
    return count <= kGuidingRegionsMax;
  }

  // False if there are too many quads.
  bool MakeQuadtrees(double fraction) {
    size_t quads = 0;
    for (size_t r = 0; r < regions_.size(); ++r) {
      Region& region = regions_[r];
      region.refined = GuidingRegion();
      if (region.total > 0) {
        region.refined.fluence_ =
            region.total / region.numbers_before[kParts] * statistics_.value_of_unit_;
        region.refined.nodes_ = MakeQuadtree(old_.regions_[r].nodes_, region, fraction);
      }
      quads += 4 * region.refined.nodes_.size() * region.copies;
      if (quads > kGuidingQuadsMax) return false;
    }
    return true;
  }

  static Nodes MakeQuadtree(const Nodes& old, const Region& region, double fraction) {
    // A square that becomes a node. source: the node that it was before; -1: it lay in one quad,
    // over which its light is taken to be even.
    struct Square {
      int source;
      double weight;
      int depth;
    };
    const auto probability = [&](double weight, int depth) {
      return (1 - kGuidingUniformShare) * (weight / region.total) +
             kGuidingUniformShare * elementary::PowerOfTwo(-2 * depth);
    };
    std::vector<Square> squares{{0, region.total, 0}};
    Nodes nodes;
    for (size_t i = 0; i < squares.size(); ++i) {
      const Square square = squares[i];
      const size_t source = static_cast<size_t>(std::max(square.source, 0));
      const int depth = square.depth + 1;
      const double whole = probability(square.weight, square.depth);
      GuidingRegion::Node node;
      for (size_t q = 0; q < 4; ++q) {
        const bool was_node = square.source >= 0;
        const double weight = was_node ? region.weights[source][q] : square.weight / 4;
        node.fraction[q] = static_cast<float>(probability(weight, depth) / whole);
        if (!(weight > fraction * region.total) || depth >= kGuidingQuadDepthMax ||
            squares.size() >= kGuidingNodesInRegionMax) {
          continue;
        }
        const int child = was_node ? old[source].child[q] : 0;
        node.child[q] = static_cast<uint16_t>(squares.size());
        squares.push_back({child != 0 ? child : -1, weight, depth});
      }
      nodes.push_back(node);
    }
    nodes.shrink_to_fit();
    return nodes;
  }

  void Copy(uint32_t from, uint32_t to, double values, GuidingField* field) const {
    const uint32_t node = old_.space_[from];
    if ((node & GuidingField::kRegionBit) != 0) {
      const Region& region = regions_[node & ~GuidingField::kRegionBit];
      CopyRegion(region, {0, kParts, region.depth}, to, values, field);
      return;
    }
    const uint32_t first = field->Halve(to);
    Copy(node, first, values, field);
    Copy(node + 1, first + 1, values, field);
  }
  void CopyRegion(const Region& region, const Parts& parts, uint32_t to, double values,
                  GuidingField* field) const {
    if (!IsHalved(region, parts, values)) {
      field->SetRegion(to, region.refined);
      return;
    }
    const uint32_t first = field->Halve(to);
    CopyRegion(region, HalfOf(parts, 0), first, values, field);
    CopyRegion(region, HalfOf(parts, 1), first + 1, values, field);
  }

  const GuidingField& old_;
  const GuidingStatistics& statistics_;
  std::vector<Region> regions_;
};

GuidingField Refine(const GuidingField& field, const GuidingStatistics& statistics, int iteration) {
  return GuidingRefinement(field, statistics).Make(iteration);
}

}  // namespace sheaf::render
