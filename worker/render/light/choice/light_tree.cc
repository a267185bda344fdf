// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Traversal of the light tree. light_tree_build.cc builds it.
#include "worker/render/light/choice/light_tree.h"

#include <cmath>

#include "common/math/lanes.h"
#include "worker/render/light/choice/light_tree_walk.h"

namespace sheaf::render {
namespace {

// For coordinates, their differences and the boxes: allows 16 roundings where at most 8 occur.
constexpr float kNodeCoordinateError = 0x1p-20f;
// Cosines this far beyond a bound still count. Covers the rounding of the angles: the sine from a
// cosine near -1 is off by up to 2^-11.5, the axis directions by less than 2^-14.
constexpr float kCosineSlack = 0x1p-10f;
// Outward rounding of the squared radius: near a grazing tangent its cosine is a small difference.
constexpr float kRadiusSquaredFactor = 1 + 0x1p-16f;
// Keep weights, their sums and products finite and positive.
constexpr float kChildWeightMin = 0x1p-100f, kChildWeightMax = 0x1p100f;
constexpr float kDistanceSquaredMin = 0x1p-125f;
// Fraction of a box's squared radius that is added to the squared distance of its lights.
constexpr float kFarPart = 1 / 8.0f;
// Variance of positions across a box, along an axis, over its squared radius: that of a cube.
constexpr float kBoxVariance = 1 / 9.0f;

// One lane per child of a node.
static_assert(LightTree::kWidth == kLaneCount);
using ShortLanes = int16_t __attribute__((vector_size(kLaneCount * sizeof(int16_t))));
using UnsignedShortLanes = uint16_t __attribute__((vector_size(kLaneCount * sizeof(uint16_t))));

template <typename IntegerLanes>
inline Lanes ToFloats(IntegerLanes lanes) {
  return __builtin_convertvector(lanes, Lanes);
}
inline Lanes LoadShorts(const int16_t (&values)[kLaneCount]) {
  return ToFloats(LoadLanes<ShortLanes>(values));
}

}  // namespace

// Estimates intensity * cosine at the light * cosine at the receiver / distance^2 for each child,
// each factor as a mean over its lights or close to it; as a product, with the lobe of the sketch
// added to the cosine at the receiver.
template <bool kIsProduct>
inline LightTree::Weights LightTree::WeighBy(const Node& node, const Receiver& receiver,
                                             [[maybe_unused]] const LobeSketch* sketch) {
  const Vec3f from_p = node.origin - receiver.p, n = receiver.n, n_abs = receiver.n_abs;
  const Vec3f step = node.step;
  const float node_reach = std::fabs(node.origin.x) + std::fabs(node.origin.y) +
                           std::fabs(node.origin.z) + 255 * (step.x + step.y + step.z);
  const float error = kNodeCoordinateError * (receiver.reach + node_reach);
  const auto box_x = LoadLanes<UnsignedShortLanes>(node.box[0]);
  const auto box_y = LoadLanes<UnsignedShortLanes>(node.box[1]);
  const auto box_z = LoadLanes<UnsignedShortLanes>(node.box[2]);
  const Lanes dx = from_p.x + step.x * ToFloats(box_x & 255);
  const Lanes dy = from_p.y + step.y * ToFloats(box_y & 255);
  const Lanes dz = from_p.z + step.z * ToFloats(box_z & 255);
  const Lanes hx = step.x * ToFloats(box_x >> 8) + error;
  const Lanes hy = step.y * ToFloats(box_y >> 8) + error;
  const Lanes hz = step.z * ToFloats(box_z >> 8) + error;
  const Lanes d_squared = Max(All(kDistanceSquaredMin), dx * dx + dy * dy + dz * dz);
  const Lanes r_squared = kRadiusSquaredFactor * (hx * hx + hy * hy + hz * hz);
  const Lanes inverse_d = 1 / Sqrt(d_squared);

  // The least angle between a normal and the direction to p: the axis's angle minus the half-angle
  // of the cone and that of the bounding sphere; "around" is the sum of these two.
  const Lanes cos_signed = (-1 / kAxisSteps) * inverse_d *
                           (dx * LoadShorts(node.axis[0]) + dy * LoadShorts(node.axis[1]) +
                            dz * LoadShorts(node.axis[2]));
  const auto emission = LoadLanes<UnsignedShortLanes>(node.emission);
  const Lanes mirror = 1 - 2 * ToFloats(emission >> 8);
  const Lanes cos_axis = Max(cos_signed, mirror * cos_signed);
  const Lanes sin_axis = Sqrt(Max(Lanes{}, 1 - cos_axis * cos_axis));
  const Lanes cos_normals = (1 / kAxisSteps) * LoadShorts(node.cos_normals);
  const Lanes sin_normals = (1 / kAxisSteps) * LoadShorts(node.sin_normals);
  const Lanes cos_sphere = Sqrt(Max(Lanes{}, d_squared - r_squared)) * inverse_d;
  const Lanes sin_sphere = Sqrt(r_squared) * inverse_d;
  const Lanes cos_around = cos_normals * cos_sphere - sin_normals * sin_sphere;
  const Lanes sin_around = sin_normals * cos_sphere + cos_normals * sin_sphere;
  const MaskLanes is_within =
      (d_squared <= r_squared) | (sin_around < 0) | (cos_axis >= cos_around);
  const Lanes cos_light = is_within ? All(1) : cos_axis * cos_around + sin_axis * sin_around;
  const Lanes cos_emission = (1 / kEmissionSteps) * ToFloats(emission & 255) - kCosineSlack;

  // The mean cosine of the lights: exact for a single normal, 1/2 along the axis for normals over a
  // hemisphere, 1/4 for normals over the sphere. The smooth curve between is within 1/4 of the
  // exact value, for two-sided lights within 1/3. The extent of the box, as seen from p, spreads
  // the normals further.
  const auto mean = LoadLanes<UnsignedShortLanes>(node.mean);
  const Lanes gathered = (1 / kMeanSteps) * ToFloats(mean & 255) * cos_sphere;
  const Lanes along = gathered * cos_signed;
  const Lanes across = Sqrt(along * along + 0.25f * Max(Lanes{}, 1 - gathered * gathered));
  const Lanes mean_cosine = 0.5f * (Max(along, -mirror * across) + across);
  const Lanes evenness = (1 / kMeanSteps) * ToFloats(mean >> 8);
  const Lanes turned = evenness + (1 - evenness) * mean_cosine;

  // Heights of the box's points over the receiver's horizon: the maximum, which alone decides
  // whether any light is visible, and the mean of the part above it. The effective distance of the
  // visible lights lies between that of the box's nearest point and that of the rest.
  const Lanes height = n.x * dx + n.y * dy + n.z * dz;
  const Lanes spread = n_abs.x * hx + n_abs.y * hy + n_abs.z * hz;
  const Lanes rise = height + spread;
  const Lanes mean_rise = height >= spread ? height : rise * rise / (4 * spread);
  const Lanes gap_x = Max(Lanes{}, Abs(dx) - hx), gap_y = Max(Lanes{}, Abs(dy) - hy),
              gap_z = Max(Lanes{}, Abs(dz) - hz);
  const Lanes gap = Sqrt(gap_x * gap_x + gap_y * gap_y + gap_z * gap_z);
  const Lanes far_squared = d_squared + kFarPart * r_squared;
  const Lanes way = Sqrt(gap * Sqrt(far_squared));
  const Lanes cos_receiver = Max(All(receiver.unhinted), Min(All(1), mean_rise / way));

  const Lanes intensity = LoadLanes<Lanes>(node.intensity);
  Lanes received = Max(All(kCosineSlack), cos_receiver);
  if constexpr (kIsProduct) {
    received += sketch->LobeAt(dx, dy, dz, inverse_d, kBoxVariance * (r_squared / d_squared));
  }
  const Lanes weight = intensity / far_squared * (Max(All(kCosineSlack), turned) * received);
  const MaskLanes is_none = (cos_light < cos_emission) | (rise < 0) | (intensity <= 0);
  Weights weights;
  weights.of_child =
      is_none ? Lanes{} : Max(All(kChildWeightMin), Min(All(kChildWeightMax), weight));
  weights.sum = Sum(weights.of_child);
  weights.intensity = (weights.sum > 0 ? is_none : MaskLanes{}) ? Lanes{} : intensity;
  weights.intensity_sum = Sum(weights.intensity);
  return weights;
}

LightTree::Weights LightTree::Weigh(const Node& node, const Receiver& receiver) {
  return WeighBy<false>(node, receiver, nullptr);
}

LightTree::Weights LightTree::WeighProduct(const Node& node, const Receiver& receiver,
                                           const LobeSketch& sketch) {
  return WeighBy<true>(node, receiver, &sketch);
}

template <typename Row>
double LightTree::Irradiance(Vec3f p, Vec3f n, Row row) const {
  return static_cast<double>(WeighNode(0, Receiver(p, n), row, 0).sum) * irradiance_scale_;
}

template <typename Row>
std::optional<ChosenLight> LightTree::Choose(Vec3f p, Vec3f n, double u, Row row) const {
  const Receiver receiver(p, n);
  const Weights weights = WeighNode(0, receiver, row, 0);
  if (!(weights.sum > 0)) return std::nullopt;
  return Descend(receiver, 0, weights, u, row, 0);
}

template <typename Row>
float LightTree::Probability(uint32_t light, Vec3f p, Vec3f n, Row row) const {
  if (slot_of_light_[light] == kNoSlot) return 0;
  SlotPath path = PathTo(light);
  const Receiver receiver(p, n);
  NodeProbability probability;
  uint32_t block = 0;
  while (path.count > 0) {
    const uint32_t slot = path.slots[--path.count];
    const Weights weights = WeighNode(slot / kWidth, receiver, row, block);
    if (slot < kWidth && !(weights.sum > 0)) return 0;
    probability = probability.Among(weights).Of(slot % kWidth);
    if (path.count > 0) {
      block = row.BlockBelow(block, slot % kWidth, path.slots[path.count - 1] / kWidth);
    }
  }
  return static_cast<float>(probability.Sum());
}

LightTree::Share LightTree::ShareOf(uint32_t light, Vec3f p, Vec3f n) const {
  if (slot_of_light_[light] == kNoSlot) return {};
  SlotPath path = PathTo(light);
  const Receiver receiver(p, n);
  NodeProbability probability;
  while (path.count > 0) {
    const uint32_t slot = path.slots[--path.count];
    const Weights weights = WeighNode(slot / kWidth, receiver, NoLightVisibilityRow(), 0);
    if (slot < kWidth && !(weights.sum > 0)) return {};
    probability = probability.Among(weights).Of(slot % kWidth);
  }
  return {probability.by_weight / (1 - kIntensityProbability), probability.Sum()};
}

#define SHEAF_INSTANTIATE_FOR(row)                                                        \
  template double LightTree::Irradiance(Vec3f, Vec3f, row) const;                         \
  template std::optional<ChosenLight> LightTree::Choose(Vec3f, Vec3f, double, row) const; \
  template float LightTree::Probability(uint32_t, Vec3f, Vec3f, row) const;
SHEAF_INSTANTIATE_FOR(NoLightVisibilityRow)
SHEAF_INSTANTIATE_FOR(LightVisibilityRow)
SHEAF_INSTANTIATE_FOR(ProductRow)
#undef SHEAF_INSTANTIATE_FOR

}  // namespace sheaf::render
