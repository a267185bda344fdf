// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light/choice/light_choice.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "common/base/check.h"
#include "common/base/vector_bytes.h"
#include "common/math/elementary.h"
#include "common/math/lanes.h"

namespace sheaf::render {
namespace {

// Fraction of the probability that is spread evenly over all lights that may reach a point.
constexpr float kUniformProbability = 0.25f;
// Minimum probability of the infinite lights, and of the local ones, where the scene has both.
constexpr double kGroupProbabilityMin = 0.1;
// Keep sums of weights finite next to a point light, and small weights above 0.
constexpr float kWeightMin = 1e-30f, kWeightMax = 1e30f;
constexpr float kCoordinateError = 0x1p-21f;
// Error bound of cosines between unit vectors in float.
constexpr float kCosineError = 0x1p-20f;
constexpr double kBelowOne = 1 - 0x1p-53;
// Keeps directions to lights around the point finite.
constexpr float kDistanceMin = 0x1p-62f;
// Variance of positions on a disk, along an axis, over its squared radius.
constexpr float kDiskVariance = 0.25f;

}  // namespace

// A group of lights that is weighted in SIMD lanes.
struct LightChoice::Block {
  explicit Block(const LightBounds* lights, size_t count);
  // Returns for each light an estimate of the unoccluded irradiance at p on a plane of normal n, or
  // on a plane that faces the light where n is zero. 0 only for lights that emit nothing, certainly
  // face away or lie behind p.
  Lanes WeightsAt(Vec3f p, Vec3f n) const { return WeightsBy<false>(p, n, nullptr); }
  // The same for what is reflected at p, in units of irradiance by the sketch's diffuse part.
  Lanes ProductsAt(Vec3f p, Vec3f n, const LobeSketch& sketch) const {
    return WeightsBy<true>(p, n, &sketch);
  }
  // Inlined into both. sketch: null in WeightsAt.
  template <bool kIsProduct>
  [[gnu::always_inline]] inline Lanes WeightsBy(Vec3f p, Vec3f n, const LobeSketch* sketch) const;

  Lanes center_x{}, center_y{}, center_z{}, center_reach{};
  Lanes normal_x{}, normal_y{}, normal_z{};
  Lanes radius{};
  // The estimate is strength / (distance^2 + nearest): `nearest` keeps that of a light with an area
  // within the irradiance of a hemisphere.
  Lanes strength{}, nearest{};
  // The light emits nothing along directions whose cosine with the normal is less.
  Lanes cos_end = All(-2);
  MaskLanes is_planar{}, is_infinite{};
};

LightChoice::Block::Block(const LightBounds* lights, size_t count) {
  constexpr float kInverseTwoPi = static_cast<float>(1 / (2 * kPi));
  for (size_t i = 0; i < count; ++i) {
    const LightBounds& light = lights[i];
    if (!(light.strength > 0)) continue;
    strength[i] = light.strength;
    is_infinite[i] = light.kind == LightBounds::Kind::kInfinite ? -1 : 0;
    if (is_infinite[i] != 0) continue;
    center_x[i] = light.center.x;
    center_y[i] = light.center.y;
    center_z[i] = light.center.z;
    center_reach[i] =
        std::fabs(light.center.x) + std::fabs(light.center.y) + std::fabs(light.center.z);
    normal_x[i] = light.normal.x;
    normal_y[i] = light.normal.y;
    normal_z[i] = light.normal.z;
    radius[i] = light.radius;
    if (light.kind == LightBounds::Kind::kPoint) {
      if (light.cos_end > 0) cos_end[i] = light.cos_end - kCosineError;
      continue;
    }
    strength[i] *= light.area;
    nearest[i] = light.area * kInverseTwoPi;
    if (light.kind != LightBounds::Kind::kPlanar) continue;
    is_planar[i] = -1;
    if (!light.two_sided) cos_end[i] = 0;
  }
}

template <bool kIsProduct>
inline Lanes LightChoice::Block::WeightsBy(Vec3f p, Vec3f n,
                                           [[maybe_unused]] const LobeSketch* sketch) const {
  const Lanes x = p.x - center_x, y = p.y - center_y, z = p.z - center_z;
  const Lanes d_squared = x * x + y * y + z * z, d = Sqrt(d_squared);
  const float reach = std::fabs(p.x) + std::fabs(p.y) + std::fabs(p.z);
  const Lanes error = kCoordinateError * (reach + center_reach);
  const Lanes height = normal_x * x + normal_y * y + normal_z * z;
  // Upper bound of the height of any part of the light over the horizon.
  const Lanes rise = radius + error - (n.x * x + n.y * y + n.z * z);
  const MaskLanes is_none = (height + error < cos_end * d) | (rise < 0);
  Lanes weight = strength / (d_squared + nearest);
  // Upper bounds of the cosines of any part of the light.
  const Lanes at_light = Abs(height) + radius;
  weight *= (is_planar & (at_light < d)) ? at_light / d : All(1);
  if constexpr (kIsProduct) {
    const Lanes inverse_d = 1 / Max(All(kDistanceMin), d);
    const Lanes spread = radius * inverse_d;
    weight *= (n == Vec3f{} ? All(1) : (rise < d ? rise / d : All(1))) +
              sketch->LobeAt(-x, -y, -z, inverse_d, kDiskVariance * spread * spread);
  } else if (n != Vec3f{}) {
    weight *= rise < d ? rise / d : All(1);
  }
  weight = Max(All(kWeightMin), weight);
  const Lanes of_infinite = kIsProduct ? strength * sketch->OfAllDirections() : strength;
  weight = Min(All(kWeightMax), is_infinite ? of_infinite : weight);
  return (strength > 0) & (is_infinite | ~is_none) ? weight : Lanes{};
}

// Selection probabilities of the lights.
struct LightChoice::Weights {
  std::array<Lanes, kLightsWeighedMax / kLaneCount> probability;  // [blocks_.size()].

  float Probability(size_t light) const {
    return probability[light / kLaneCount][light % kLaneCount];
  }
};

LightChoice::LightChoice() = default;
LightChoice::~LightChoice() = default;
LightChoice::LightChoice(LightChoice&&) noexcept = default;
LightChoice& LightChoice::operator=(LightChoice&&) noexcept = default;

LightChoice::LightChoice(std::vector<LightBounds> lights, bool splits)
    : count_(lights.size()),
      splits_(splits && count_ > 1),
      uses_tree_(splits_ || count_ > kLightsWeighedMax) {
  if (!uses_tree_) {
    for (size_t i = 0; i < count_; i += kLaneCount) {
      blocks_.emplace_back(&lights[i], std::min(kLaneCount, count_ - i));
    }
    return;
  }
  std::vector<double> irradiances;
  for (uint32_t i = 0; i < lights.size(); ++i) {
    const float irradiance = lights[i].strength;
    if (lights[i].kind != LightBounds::Kind::kInfinite) continue;
    if (!(irradiance > 0 && std::isfinite(irradiance))) continue;
    infinite_lights_.push_back(i);
    irradiances.push_back(static_cast<double>(irradiance));
    infinite_irradiance_ += irradiances.back();
  }
  infinite_ = DiscreteDistribution(irradiances);
  tree_ = LightTree(lights, splits_);
}

template <typename Row>
inline LightChoice::Weights LightChoice::Weigh(Vec3f p, Vec3f n, [[maybe_unused]] Row row) const {
  Weights w;
  float sum = 0, positive_count = 0;
  for (size_t b = 0; b < blocks_.size(); ++b) {
    if constexpr (kHasSketch<Row>) {
      w.probability[b] = blocks_[b].ProductsAt(p, n, *row.sketch);
    } else {
      w.probability[b] = blocks_[b].WeightsAt(p, n);
    }
    if constexpr (kHasFactors<Row>) {
      if (!kHasSketch<Row> || row.steps != nullptr) {
        w.probability[b] *= VisibilityFactors(row, b * kLaneCount);
      }
    }
    sum += Sum(w.probability[b]);
    positive_count += Sum(w.probability[b] > 0 ? All(1) : Lanes{});
  }
  if (positive_count == 0) return w;
  // A single light has probability 1 exactly.
  const bool is_alone = positive_count == 1;
  const float scale = is_alone ? 0 : (1 - kUniformProbability) / sum;
  const float even = is_alone ? 1 : kUniformProbability / positive_count;
  for (size_t b = 0; b < blocks_.size(); ++b) {
    const Lanes weight = w.probability[b];
    w.probability[b] = weight > 0 ? weight * scale + even : Lanes{};
  }
  return w;
}

// The probability of choosing an infinite light: proportional to the irradiance that each of the
// two groups may give at p.
template <typename Row>
double LightChoice::InfiniteProbability(Vec3f p, Vec3f n, Row row) const {
  if (infinite_lights_.empty()) return 0;
  const double local_irradiance = tree_.empty() ? 0 : tree_.Irradiance(p, n, row);
  if (!(local_irradiance > 0)) return 1;
  double infinite_irradiance = infinite_irradiance_;
  if constexpr (kHasSketch<Row>) {
    infinite_irradiance *= static_cast<double>(row.sketch->OfAllDirections());
  }
  if constexpr (kHasFactors<Row>) {
    const size_t slot = row.links == nullptr ? tree_.visibility_slot_count() : kCutSlots;
    if (!kHasSketch<Row> || row.steps != nullptr) {
      infinite_irradiance *= static_cast<double>(VisibilityFactor(row, slot));
    }
  }
  return std::clamp(infinite_irradiance / (infinite_irradiance + local_irradiance),
                    kGroupProbabilityMin, 1 - kGroupProbabilityMin);
}

float LightChoice::ProbabilityInfinite(size_t rank, double infinite_probability) const {
  return static_cast<float>(infinite_probability * infinite_.Probability(rank));
}

std::optional<size_t> LightChoice::InfiniteRank(uint32_t light) const {
  const auto infinite = std::lower_bound(infinite_lights_.begin(), infinite_lights_.end(), light);
  if (infinite == infinite_lights_.end() || *infinite != light) return std::nullopt;
  return static_cast<size_t>(infinite - infinite_lights_.begin());
}

LightChoice::Estimate LightChoice::EstimateOf(uint32_t light, Vec3f p, Vec3f n) const {
  if (!uses_tree_) {
    double all = 0, of_light = 0;
    for (size_t i = 0; i < count_; i += kLaneCount) {
      const Lanes weights = blocks_[i / kLaneCount].WeightsAt(p, n);
      all += static_cast<double>(Sum(weights));
      if (light / kLaneCount == i / kLaneCount) {
        of_light = static_cast<double>(weights[light % kLaneCount]);
      }
    }
    return {all, all > 0 ? of_light / all : 0, static_cast<double>(Probability(light, p, n))};
  }
  const double local = tree_.empty() ? 0 : tree_.Irradiance(p, n),
               all = local + infinite_irradiance_;
  if (!(all > 0)) return {};
  if (const std::optional<size_t> rank = InfiniteRank(light)) {
    const double of_group = infinite_.Probability(*rank);
    return {all, infinite_irradiance_ / all * of_group,
            InfiniteProbability(p, n, NoLightVisibilityRow()) * of_group};
  }
  if (tree_.empty()) return {all, 0, 0};
  const LightTree::Share of_tree = tree_.ShareOf(light, p, n);
  const double of_group = 1 - InfiniteProbability(p, n, NoLightVisibilityRow());
  return {all, local / all * of_tree.estimate, of_group * of_tree.probability};
}

size_t LightChoice::visibility_slot_count() const {
  if (count_ <= 1) return 0;
  if (!uses_tree_) return blocks_.size() * kLaneCount;
  return tree_.visibility_slot_count() + 1;
}

bool LightChoice::HasVisibilitySlot(size_t slot) const {
  if (!uses_tree_) return slot < count_;
  if (slot == tree_.visibility_slot_count()) return !infinite_lights_.empty();
  return tree_.HasVisibilitySlot(slot);
}

uint64_t LightChoice::memory_bytes() const {
  return VectorBytes(blocks_, infinite_lights_) + tree_.size_bytes() + infinite_.size_bytes();
}

template <typename Row>
std::optional<ChosenLight> LightChoice::Choose(Vec3f p, Vec3f n, float u, uint64_t salt,
                                               Row row) const {
  if constexpr (kHasSketch<Row>) {
    if (row.sketch == nullptr) return Choose(p, n, u, salt, LightVisibilityRow(row));
  } else if constexpr (kHasFactors<Row>) {
    if (row.steps == nullptr) return Choose(p, n, u, salt);
  }
  if (count_ == 1) return ChosenLight{0, 1};
  if (uses_tree_) {
    const double x = ExtendBits(u, salt);
    if (infinite_lights_.empty()) {
      return tree_.empty() ? std::nullopt : tree_.Choose(p, n, std::min(x, kBelowOne), row);
    }
    const double infinite_probability = InfiniteProbability(p, n, row);
    if (x < infinite_probability) {
      const size_t rank = infinite_.Sample(std::min(x / infinite_probability, kBelowOne));
      return ChosenLight{infinite_lights_[rank], ProbabilityInfinite(rank, infinite_probability)};
    }
    if (tree_.empty()) return std::nullopt;
    const double local_probability = 1 - infinite_probability;
    std::optional<ChosenLight> chosen = tree_.Choose(
        p, n, std::min((x - infinite_probability) / local_probability, kBelowOne), row);
    if (chosen) chosen->probability *= static_cast<float>(local_probability);
    return chosen;
  }
  const Weights w = Weigh(p, n, row);
  // Where rounding leaves the sum below u, the last light of positive probability is chosen.
  size_t chosen = 0;
  float chosen_probability = 0, begin = 0;
  for (size_t i = 0; i < count_; ++i) {
    const float probability = w.Probability(i);
    if (!(probability > 0)) continue;
    chosen = i;
    chosen_probability = probability;
    begin += probability;
    if (u < begin) break;
  }
  if (!(chosen_probability > 0)) return std::nullopt;
  return ChosenLight{static_cast<uint32_t>(chosen), chosen_probability};
}

template <typename Row>
float LightChoice::Probability(uint32_t light, Vec3f p, Vec3f n, Row row) const {
  if constexpr (kHasSketch<Row>) {
    if (row.sketch == nullptr) return Probability(light, p, n, LightVisibilityRow(row));
  } else if constexpr (kHasFactors<Row>) {
    if (row.steps == nullptr) return Probability(light, p, n);
  }
  if (count_ == 1) return 1;
  if (!uses_tree_) return Weigh(p, n, row).Probability(light);
  const double infinite_probability = InfiniteProbability(p, n, row);
  if (const std::optional<size_t> rank = InfiniteRank(light)) {
    return ProbabilityInfinite(*rank, infinite_probability);
  }
  return tree_.Probability(light, p, n, row) * static_cast<float>(1 - infinite_probability);
}

template <typename Row>
LightCut LightChoice::CutAt(Vec3f p, Vec3f n, uint32_t samples_max, Row row) const {
  SHEAF_DCHECK(splits_ && samples_max >= 2 && samples_max <= kPartsMax);
  LightCut cut;
  cut.has_infinite = !infinite_lights_.empty();
  if (tree_.empty()) return cut;
  const size_t local_max = samples_max - (cut.has_infinite ? 1 : 0);
  if constexpr (kHasFactors<Row>) {
    cut.local =
        row.steps == nullptr ? tree_.CutAt(p, n, local_max) : tree_.CutAt(p, n, local_max, row);
  } else {
    cut.local = tree_.CutAt(p, n, local_max);
  }
  return cut;
}

template <typename Row>
ChosenLight LightChoice::ChooseFrom(const LightCut& cut, size_t part, Vec3f p, Vec3f n, float u,
                                    uint64_t salt, Row row) const {
  if constexpr (kHasFactors<Row>) {
    if (row.steps == nullptr) return ChooseFrom(cut, part, p, n, u, salt);
  }
  const double x = ExtendBits(u, salt);
  if (cut.has_infinite && part == 0) {
    const size_t rank = infinite_.Sample(x);
    return {infinite_lights_[rank], ProbabilityInfinite(rank, 1)};
  }
  return tree_.ChooseFrom(cut.local, part - (cut.has_infinite ? 1 : 0), p, n, x, row);
}

template <typename Row>
float LightChoice::Probability(uint32_t light, Vec3f p, Vec3f n, SplitLightQuery<Row> query) const {
  if (!splits_ || query.samples_max <= 1) return Probability(light, p, n, query.row);
  if constexpr (kHasSketch<Row>) {
    return Probability(light, p, n,
                       SplitLightQuery<LightVisibilityRow>{query.row, query.samples_max});
  } else {
    return ProbabilityInPart(light, p, n, query);
  }
}

template <typename Row>
float LightChoice::ProbabilityInPart(uint32_t light, Vec3f p, Vec3f n,
                                     SplitLightQuery<Row> query) const {
  if constexpr (kHasFactors<Row>) {
    if (query.row.steps == nullptr) {
      return Probability(light, p, n, SplitLightQuery<NoLightVisibilityRow>{{}, query.samples_max});
    }
  }
  if (const std::optional<size_t> rank = InfiniteRank(light)) return ProbabilityInfinite(*rank, 1);
  if (tree_.empty()) return 0;
  const LightCut cut = CutAt(p, n, query.samples_max, query.row);
  return tree_.ProbabilityIn(cut.local, light, p, n, query.row);
}

#define SHEAF_INSTANTIATE_FOR(row)                                                            \
  template std::optional<ChosenLight> LightChoice::Choose(Vec3f, Vec3f, float, uint64_t, row) \
      const;                                                                                  \
  template float LightChoice::Probability(uint32_t, Vec3f, Vec3f, row) const;                 \
  template float LightChoice::Probability(uint32_t, Vec3f, Vec3f, SplitLightQuery<row>) const;
SHEAF_INSTANTIATE_FOR(NoLightVisibilityRow)
SHEAF_INSTANTIATE_FOR(LightVisibilityRow)
SHEAF_INSTANTIATE_FOR(ProductRow)
#undef SHEAF_INSTANTIATE_FOR

#define SHEAF_INSTANTIATE_FOR(row)                                                           \
  template LightCut LightChoice::CutAt(Vec3f, Vec3f, uint32_t, row) const;                   \
  template ChosenLight LightChoice::ChooseFrom(const LightCut&, size_t, Vec3f, Vec3f, float, \
                                               uint64_t, row) const;
SHEAF_INSTANTIATE_FOR(NoLightVisibilityRow)
SHEAF_INSTANTIATE_FOR(LightVisibilityRow)
#undef SHEAF_INSTANTIATE_FOR

}  // namespace sheaf::render
