// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightTree::CutAt: which parts of the lights a point samples.
//
// A part's estimate is the sum of the estimates W of its children. Its uncertainty is the standard
// deviation of the sum of its lights' contributions e * g, where the energies e vary as they do,
// and g = 1 / distance^2 with a distance that is uniform between the least and the largest one of
// the sphere about the part's box. With d the distance of its center and r its radius,
//
//   cv(g)^2 = 4 r^2 / (3 (d^2 - r^2)),   cv(e)^2 = count * sum(e^2) / sum(e)^2 - 1
//   uncertainty = W * sqrt((1 + cv(g)^2) (1 + cv(e)^2) - 1)
//
// Source: Conty Estevez and Kulla 2018. The paper compares the deviation with a unit of light,
// after a map to (0, 1]; here the unit is the estimate of all lights at the point, so that the
// units of the scene do not matter.
//
// A division halves the part's estimate as nearly as runs of children allow. A half that is too
// dark for a sample of its own stays with the other: less than 1 / limit of an even share. With few
// samples a dark part takes one that a bright part needs, with many it does not matter.
#include <algorithm>
#include <cmath>

#include "worker/render/light/choice/light_tree_walk.h"

namespace sheaf::render {
namespace {

// A part is divided where 1 / (1 + uncertainty / estimate of all lights) is below this.
constexpr float kCertaintyMin = 0.95f;
// Bounds the coefficient of variation, which is infinite within a part's sphere: a dark part around
// the point does not come before a bright one.
constexpr float kVariationMax = 8;

}  // namespace

class LightTree::Splitter {
 public:
  Splitter(const LightTree& tree, const Receiver& receiver) : tree_(tree), receiver_(receiver) {}

  template <typename Row>
  Cut Split(size_t parts_max, Row row) {
    Cut cut;
    const Weights all = tree_.WeighNode(0, receiver_, row, 0);
    if (!(all.sum > 0)) return cut;
    estimate_of_all_ = all.sum;
    estimate_min_ = all.sum / static_cast<float>(parts_max * parts_max);
    cut.parts_[0] = PartOf(all, 0, 0, kWidth, 0);
    cut.size_ = 1;
    while (cut.size_ > 0 && cut.size_ < parts_max) {
      // Among equals, the first.
      Cut::Part* const part = std::max_element(
          cut.parts_.data(), cut.parts_.data() + cut.size_,
          [](const Cut::Part& a, const Cut::Part& b) { return a.uncertainty < b.uncertainty; });
      if (!(estimate_of_all_ < kCertaintyMin * (estimate_of_all_ + part->uncertainty))) break;
      Divide(part, &cut, row);
    }
    return cut;
  }

 private:
  // The children [first, end) of the node, whose children have the weights.
  Cut::Part PartOf(const Weights& weights, uint32_t node, uint32_t first, uint32_t end,
                   uint32_t block) const {
    Cut::Part part{{Lanes{}, Lanes{}, 0, 0}, node, first, end, block, 0};
    for (uint32_t i = first; i < end; ++i) {
      part.weights.of_child[i] = weights.of_child[i];
      part.weights.intensity[i] = weights.intensity[i];
    }
    part.weights.sum = Sum(part.weights.of_child);
    part.weights.intensity_sum = Sum(part.weights.intensity);
    part.uncertainty = part.weights.sum * Variation(part);
    return part;
  }

  // The coefficient of variation of the lights' contributions. 0 for a single light.
  float Variation(const Cut::Part& part) const {
    const Node& node = tree_.nodes_[part.node];
    const NodeEnergies& energies = tree_.energies_[part.node];
    Vec3f lower{}, upper{};  // The corners of the boxes, relative to the point.
    float count = 0, square = 0;
    for (uint32_t i = part.first; i < part.end; ++i) {
      if (!(part.weights.of_child[i] > 0)) continue;
      for (size_t axis = 0; axis < 3; ++axis) {
        const float origin = node.origin[axis] - receiver_.p[axis], step = node.step[axis];
        const auto center = static_cast<float>(node.box[axis][i] & 255),
                   half = static_cast<float>(node.box[axis][i] >> 8);
        const float from = origin + step * (center - half), to = origin + step * (center + half);
        lower[axis] = count > 0 ? std::min(lower[axis], from) : from;
        upper[axis] = count > 0 ? std::max(upper[axis], to) : to;
      }
      const float fraction = node.intensity[i] / part.weights.intensity_sum;
      square += energies.square[i] * fraction * fraction;
      count += energies.count[i];
    }
    if (!(count > 1)) return 0;
    const float d_squared = LengthSquared(0.5f * lower + 0.5f * upper);
    const float r_squared = LengthSquared(0.5f * upper - 0.5f * lower);
    constexpr float kSquareMax = kVariationMax * kVariationMax;
    const float of_geometry =
        d_squared > r_squared ? 4 * r_squared / (3 * (d_squared - r_squared)) : kSquareMax;
    const float of_energy = std::max(0.0f, count * square - 1);
    return std::sqrt(std::min(
        kSquareMax,
        (1 + std::min(kSquareMax, of_geometry)) * (1 + std::min(kSquareMax, of_energy)) - 1));
  }

  // Divides the part of the cut, or describes it more finely, or drops it if nothing comes from it.
  template <typename Row>
  void Divide(Cut::Part* part, Cut* cut, Row row) {
    const Weights& weights = part->weights;
    uint32_t count = 0, last = part->first, middle = part->first;
    float below = 0, of_half = 0;
    for (uint32_t i = part->first; i < part->end; ++i) {
      if (!(weights.of_child[i] > 0)) continue;
      if (count > 0 && std::min(below, weights.sum - below) > of_half) {
        of_half = std::min(below, weights.sum - below);
        middle = i;
      }
      below += weights.of_child[i];
      last = i;
      ++count;
    }
    if (count == 1) return Refine(last, part, cut, row);
    if (!(of_half >= estimate_min_)) {
      part->uncertainty = 0;
      return;
    }
    const Cut::Part whole = *part;
    *part = PartOf(whole.weights, whole.node, whole.first, middle, whole.block);
    cut->parts_[cut->size_++] = PartOf(whole.weights, whole.node, middle, whole.end, whole.block);
  }

  // Replaces the part, which is one child, by the children of that.
  template <typename Row>
  void Refine(uint32_t place, Cut::Part* part, Cut* cut, Row row) {
    const uint32_t child = tree_.nodes_[part->node].child[place];
    SHEAF_DCHECK((child & kLightBit) == 0);
    const uint32_t block = row.BlockBelow(part->block, place, child);
    const Weights weights = tree_.WeighNode(child, receiver_, row, block);
    if (weights.sum > 0) {
      *part = PartOf(weights, child, 0, kWidth, block);
    } else {
      *part = cut->parts_[--cut->size_];
    }
  }

  const LightTree& tree_;
  const Receiver& receiver_;
  float estimate_of_all_ = 0;
  float estimate_min_ = 0;  // For a part.
};

template <typename Row>
LightTree::Cut LightTree::CutAt(Vec3f p, Vec3f n, size_t parts_max, Row row) const {
  SHEAF_DCHECK(!energies_.empty() && parts_max >= 1 && parts_max <= kPartsMax);
  const Receiver receiver(p, n);
  return Splitter(*this, receiver).Split(parts_max, row);
}

template <typename Row>
ChosenLight LightTree::ChooseFrom(const Cut& cut, size_t part, Vec3f p, Vec3f n, double u,
                                  Row row) const {
  const Cut::Part& from = cut.parts_[part];
  return Descend(Receiver(p, n), from.node, from.weights, u, row, from.block);
}

template <typename Row>
float LightTree::ProbabilityIn(const Cut& cut, uint32_t light, Vec3f p, Vec3f n, Row row) const {
  if (slot_of_light_[light] == kNoSlot) return 0;
  const SlotPath path = PathTo(light);
  // The part, and the light's slot in its node.
  const Cut::Part* part = nullptr;
  size_t at = 0;
  for (size_t i = 0; i < cut.size() && part == nullptr; ++i) {
    const Cut::Part& candidate = cut.parts_[i];
    for (at = 0; at < path.count; ++at) {
      const uint32_t place = path.slots[at] % kWidth;
      const bool holds = path.slots[at] / kWidth == candidate.node && place >= candidate.first &&
                         place < candidate.end;
      if (!holds) continue;
      part = &candidate;
      break;
    }
  }
  if (part == nullptr) return 0;
  const Receiver receiver(p, n);
  NodeProbability probability = NodeProbability().Among(part->weights).Of(path.slots[at] % kWidth);
  uint32_t block = part->block;
  while (at > 0) {
    const uint32_t above = path.slots[at], slot = path.slots[--at];
    block = row.BlockBelow(block, above % kWidth, slot / kWidth);
    const Weights weights = WeighNode(slot / kWidth, receiver, row, block);
    probability = probability.Among(weights).Of(slot % kWidth);
  }
  return static_cast<float>(probability.Sum());
}

#define SHEAF_INSTANTIATE_FOR(row)                                                                 \
  template LightTree::Cut LightTree::CutAt(Vec3f, Vec3f, size_t, row) const;                       \
  template ChosenLight LightTree::ChooseFrom(const Cut&, size_t, Vec3f, Vec3f, double, row) const; \
  template float LightTree::ProbabilityIn(const Cut&, uint32_t, Vec3f, Vec3f, row) const;
SHEAF_INSTANTIATE_FOR(NoLightVisibilityRow)
SHEAF_INSTANTIATE_FOR(LightVisibilityRow)
#undef SHEAF_INSTANTIATE_FOR

}  // namespace sheaf::render
