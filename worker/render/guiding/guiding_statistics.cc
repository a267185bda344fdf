// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/guiding/guiding_statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "common/base/check.h"
#include "common/base/vector_bytes.h"
#include "common/math/elementary.h"
#include "worker/render/sampling/equal_area_map.h"

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
    : field_(field), numbers_(field.regions_.size() * kParts), shares_(field.regions_.size()) {
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

void GuidingStatistics::Add(const FoundLight& found) {
  const GuidingField::Place place = field_.PlaceOf(found.from);
  const GuidingRegion& region = field_.regions_[place.region];
  if (found.scattering_part >= 0 && std::isfinite(found.scattered)) {
    shares_.Add(place.region, region.share_, found.scattered * units_per_value_,
                found.scattering_part);
  }
  if (found.is_specular) return;
  size_t part = 0;
  for (int i = 0; i < GuidingField::kHalvingsCounted; ++i) {
    part = 2 * part + field_.HalfOf(place, place.depth + i);
  }
  numbers_[place.region * kParts + part].fetch_add(1, kRelaxed);
  if (!std::isfinite(found.scattered)) {
    non_finite_.fetch_add(1, kRelaxed);
    return;
  }
  double units = found.scattered * units_per_value_;
  if (units > kGuidingValueMax) {
    clamped_.fetch_add(1, kRelaxed);
    units = kGuidingValueMax;
  }
  if (!(units >= 0.5)) return;  // Rounds to 0.
  const uint32_t quad = region.QuadOf(EqualAreaSphereToSquare(found.w)).index;
  sums_[first_quad_[place.region] + quad].fetch_add(static_cast<uint64_t>(units + 0.5), kRelaxed);
}

uint64_t GuidingStatistics::memory_bytes() const {
  return sizeof(*this) + VectorBytes(first_quad_, sums_, numbers_) + shares_.memory_bytes();
}

// One call of Refine. Sums become doubles, which are added in the order of the nodes: the same bits
// everywhere.
class GuidingRefinement {
 public:
  GuidingRefinement(const GuidingField& field, const GuidingStatistics& statistics,
                    const GuidingSums& earlier)
      : old_(field), statistics_(statistics), earlier_(earlier), regions_(field.regions_.size()) {
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
  // By the field that Make returned.
  GuidingSums TakeSums() { return std::move(sums_); }

 private:
  static constexpr size_t kParts = GuidingStatistics::kParts;
  using Nodes = std::vector<GuidingRegion::Node>;

  struct Region {
    std::vector<std::array<double, 4>> weights;  // [node][quad]: sums, of the nodes below too.
    double total = 0;
    double number = 0;                                // The number of values, in all iterations.
    std::array<double, kParts + 1> numbers_before{};  // Values in all parts before this one.
    int depth = 0;
    size_t copies = 1;  // Regions that take its place.
    GuidingRegion refined;
    std::vector<double> refined_sums;  // [node][quad]: 0 where a node divides the quad.
  };
  // Parts [begin, end) of a region, at some depth in the tree over space.
  struct Parts {
    size_t begin = 0, end = kParts;
    int depth = 0;
  };

  void Load(size_t r) {
    const Nodes& nodes = old_.regions_[r].nodes_;
    Region& region = regions_[r];
    const auto found_in = [&](size_t quad) {
      return statistics_.sums_[statistics_.first_quad_[r] + quad].load(kRelaxed);
    };
    bool finds_light = false;
    for (size_t quad = 0; quad < 4 * nodes.size(); ++quad) finds_light |= found_in(quad) > 0;
    const bool has_earlier = finds_light && r < earlier_.quads.size();
    const auto sum_in = [&](size_t quad) {
      return static_cast<double>(found_in(quad)) + (has_earlier ? earlier_.quads[r][quad] : 0);
    };
    region.weights.resize(nodes.size());
    const auto sum_of = [](const std::array<double, 4>& w) { return w[0] + w[1] + w[2] + w[3]; };
    for (size_t i = nodes.size(); i-- > 0;) {
      for (size_t q = 0; q < 4; ++q) {
        const size_t child = nodes[i].child[q];
        region.weights[i][q] = child != 0 ? sum_of(region.weights[child]) : sum_in(4 * i + q);
      }
    }
    region.total = sum_of(region.weights[0]);
    for (size_t part = 0; part < kParts; ++part) {
      const uint64_t number = statistics_.numbers_[r * kParts + part].load(kRelaxed);
      region.numbers_before[part + 1] = region.numbers_before[part] + static_cast<double>(number);
    }
    region.number = region.numbers_before[kParts] + (has_earlier ? earlier_.numbers[r] : 0);
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
      region.refined_sums.assign(4 * region.refined.nodes_.size(), 0);
      if (region.total > 0) {
        region.refined.scattered_light_ = region.total / region.number * statistics_.value_of_unit_;
        region.refined.share_ =
            statistics_.shares_.BestOf(static_cast<uint32_t>(r), old_.regions_[r].share_);
        MakeQuadtree(old_.regions_[r].nodes_, fraction, &region);
      }
      quads += 4 * region.refined.nodes_.size() * region.copies;
      if (quads > kGuidingQuadsMax) return false;
    }
    return true;
  }

  // Sets the refined region's nodes and their sums.
  static void MakeQuadtree(const Nodes& old, double fraction, Region* its) {
    const Region& region = *its;
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
    std::vector<double> sums;
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
        sums.push_back(weight);
        if (!(weight > fraction * region.total) || depth >= kGuidingQuadDepthMax ||
            squares.size() >= kGuidingNodesInRegionMax) {
          continue;
        }
        const int child = was_node ? old[source].child[q] : 0;
        sums.back() = 0;
        node.child[q] = static_cast<uint16_t>(squares.size());
        squares.push_back({child != 0 ? child : -1, weight, depth});
      }
      nodes.push_back(node);
    }
    nodes.shrink_to_fit();
    its->refined.nodes_ = std::move(nodes);
    its->refined_sums = std::move(sums);
  }

  void Copy(uint32_t from, uint32_t to, double values, GuidingField* field) {
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
                  GuidingField* field) {
    if (!IsHalved(region, parts, values)) {
      field->SetRegion(to, region.refined);
      AddSums(region, parts);
      return;
    }
    const uint32_t first = field->Halve(to);
    CopyRegion(region, HalfOf(parts, 0), first, values, field);
    CopyRegion(region, HalfOf(parts, 1), first + 1, values, field);
  }

  // A part of a region has found as much of its light as it has of its values.
  void AddSums(const Region& region, const Parts& parts) {
    const double all = region.numbers_before[kParts];
    const double part =
        all > 0 ? (region.numbers_before[parts.end] - region.numbers_before[parts.begin]) / all : 1;
    std::vector<double>& quads = sums_.quads.emplace_back(region.refined_sums);
    for (double& sum : quads) sum *= part;
    sums_.numbers.push_back(region.number * part);
  }

  const GuidingField& old_;
  const GuidingStatistics& statistics_;
  const GuidingSums& earlier_;
  GuidingSums sums_;
  std::vector<Region> regions_;
};

GuidingField Refine(const GuidingField& field, const GuidingStatistics& statistics, int iteration,
                    GuidingSums* sums) {
  GuidingRefinement refinement(field, statistics, *sums);
  GuidingField refined = refinement.Make(iteration);
  *sums = refinement.TakeSums();
  return refined;
}

GuidingField Refine(const GuidingField& field, const GuidingStatistics& statistics, int iteration) {
  GuidingSums sums;
  return Refine(field, statistics, iteration, &sums);
}

}  // namespace sheaf::render
