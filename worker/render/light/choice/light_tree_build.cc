// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Lights > LightTree, from the root down. Each node's lights are split in two along one axis, and
// the costlier part in two again, until there are eight parts. The split is the cheapest of a few
// candidates along each axis by the surface area orientation heuristic (Conty Estevez and Kulla
// 2018, sec. 4.4): intensity * area * measure of orientations, which measures the uncertainty of a
// node's estimates. The area is that of the sphere about the box, which is the bound that a walk
// uses.
//
// Sums run in a fixed order and elementary functions are our own, so every machine builds the same
// tree.
#include <algorithm>
#include <array>
#include <cmath>

#include "common/base/check.h"
#include "common/base/large_pages.h"
#include "worker/render/light/choice/light_cluster.h"
#include "worker/render/light/choice/light_tree.h"

namespace sheaf::render {
namespace {

// Below this level nodes are split into eight parts of equal number, which suffices for 2^36
// lights.
constexpr int kLevelsByCostMax = LightTree::kDepthMax - 12;
// Number of intervals along each axis; candidate splits lie between them.
constexpr size_t kIntervalCount = 12;
// Lower bound of a light's intensity as a fraction of the total.
constexpr double kIntensityPartMin = 0x1p-60;
// Rounds cones outward by more than the quantization error of the axes.
constexpr float kNodeConeSlack = 0x1p-14f;
// Maximum distance at which squared distances stay in the range of float.
constexpr float kReachMax = 0x1p60f;

struct Part {
  size_t begin = 0, end = 0;  // Range of the entries.
  LightCluster cluster;
  float cost = 0;
  size_t size() const { return end - begin; }
};

// Intervals of the lights' centers along an axis.
struct Intervals {
  Intervals(const LightCluster& cluster, size_t along)
      : axis(along),
        lower(cluster.center_lower[along]),
        scale(static_cast<float>(kIntervalCount) /
              (cluster.center_upper[along] - cluster.center_lower[along])) {}
  bool IsUsable() const { return std::isfinite(scale); }
  size_t Of(const LightEntry& entry) const {
    const auto i = static_cast<int32_t>((entry.center[axis] - lower) * scale);
    return std::min(static_cast<size_t>(i), kIntervalCount - 1);
  }
  size_t axis;
  float lower, scale;
};

// Returns false for an excluded light. *intensity: in the unit of the input.
bool MakeEntry(const LightBounds& light, uint32_t index, LightEntry* entry, double* intensity) {
  entry->center = light.center;
  entry->half = {light.radius, light.radius, light.radius};
  entry->light = index;
  const double strength = static_cast<double>(light.strength);
  const Vec3f n = light.normal;
  switch (light.kind) {
    case LightBounds::Kind::kInfinite:
      return false;
    case LightBounds::Kind::kPlanar:
      *intensity = strength * static_cast<double>(light.area);
      entry->normal = n;
      entry->two_sided = light.two_sided;
      entry->by_cosine = true;
      entry->half = Vec3f{std::sqrt(n.y * n.y + n.z * n.z), std::sqrt(n.z * n.z + n.x * n.x),
                          std::sqrt(n.x * n.x + n.y * n.y)} *
                    light.radius;
      break;
    case LightBounds::Kind::kSphere:
      *intensity = strength * static_cast<double>(light.area);
      break;
    case LightBounds::Kind::kPoint:
      *intensity = strength;
      if (light.cos_end > 0) {
        entry->normal = n;
        entry->cos_emission = light.cos_end;
      }
      break;
  }
  // Orients two-sided lights so that normals that differ only in sign add up.
  const float sign = n.z != 0 ? n.z : (n.y != 0 ? n.y : n.x);
  if (entry->two_sided && sign < 0) entry->normal = -entry->normal;
  const float reach = std::fabs(light.center.x) + std::fabs(light.center.y) +
                      std::fabs(light.center.z) + light.radius;
  return *intensity > 0 && std::isfinite(*intensity) &&
         std::isfinite(LengthSquared(entry->normal)) && reach <= kReachMax;
}

}  // namespace

class LightTree::Builder {
 public:
  Builder(LightTree* tree, bool splits) : tree_(*tree), splits_(splits) {}

  void Build(const std::vector<LightBounds>& lights) {
    SHEAF_CHECK(lights.size() <= kLightsMax);
    tree_.slot_of_light_.assign(lights.size(), kNoSlot);
    MakeEntries(lights);
    if (entries_.empty()) return;
    nodes_.reserve(entries_.size() / 4);
    BuildNode(PartOf(0, entries_.size()), kNoSlot, 1);
    tree_.nodes_.reserve(nodes_.size());
    AdviseHugePages(tree_.nodes_.data(), nodes_.size() * sizeof(Node));
    MoveNodes(BrightestFirst());
  }

 private:
  void MakeEntries(const std::vector<LightBounds>& lights);
  Part PartOf(size_t begin, size_t end) const;
  float BuildNode(const Part& part, uint32_t parent, int level);
  size_t SplitInto(std::array<Part, kWidth>* parts, bool by_cost);
  bool SplitByCost(const Part& part, Part* left, Part* right);
  std::vector<uint32_t> BrightestFirst() const;
  void MoveNodes(const std::vector<uint32_t>& order);
  static void EncodeBoxes(const std::array<Part, kWidth>& parts, size_t count, Node* node);
  void EncodeCone(const Part& part, size_t place, Node* node) const;
  void EncodeMean(const Part& part, size_t place, Node* node) const;
  void MeasureEnergies(const Part& part, size_t place, NodeEnergies* energies) const;

  LightTree& tree_;
  const bool splits_;
  std::vector<Node> nodes_;
  std::vector<NodeEnergies> energies_;  // By node if the tree is built for splits.
  OrientationTable orientation_;
  std::vector<LightEntry> entries_;
};

LightTree::LightTree(const std::vector<LightBounds>& lights, bool splits) {
  Builder(this, splits).Build(lights);
}

// Scales intensities so that an estimate of irradiance is about 1 at distances of the lights'
// extent: float then holds the values at any scale of the scene.
void LightTree::Builder::MakeEntries(const std::vector<LightBounds>& lights) {
  entries_.reserve(lights.size());
  std::vector<double> intensities;
  intensities.reserve(lights.size());
  double total = 0;
  LightCluster all;
  for (uint32_t i = 0; i < lights.size(); ++i) {
    LightEntry entry;
    double intensity = 0;
    if (!MakeEntry(lights[i], i, &entry, &intensity)) continue;
    entries_.push_back(entry);
    intensities.push_back(intensity);
    total += intensity;
    all.Add(entry);
  }
  if (entries_.empty()) return;
  const double size_squared = LengthSquared(ToDouble(all.upper) - ToDouble(all.lower));
  const int size_exponent = size_squared > 0 ? std::clamp(std::ilogb(size_squared), -100, 100) : 0;
  const int exponent = size_exponent - std::ilogb(total);
  tree_.irradiance_scale_ = std::ldexp(1.0, -exponent);
  for (size_t i = 0; i < entries_.size(); ++i) {
    entries_[i].intensity = static_cast<float>(
        std::ldexp(std::max(intensities[i], total * kIntensityPartMin), exponent));
  }
}

Part LightTree::Builder::PartOf(size_t begin, size_t end) const {
  Part part;
  part.begin = begin;
  part.end = end;
  for (size_t i = begin; i < end; ++i) part.cluster.Add(entries_[i]);
  return part;
}

// Returns the sum of the lights' intensities.
float LightTree::Builder::BuildNode(const Part& part, uint32_t parent, int level) {
  tree_.depth_ = std::max(tree_.depth_, level);
  const auto index = static_cast<uint32_t>(nodes_.size());
  nodes_.emplace_back();
  std::array<Part, kWidth> parts;
  parts[0] = part;
  const size_t count = SplitInto(&parts, level <= kLevelsByCostMax);
  EncodeBoxes(parts, count, &nodes_[index]);
  for (size_t i = 0; i < count; ++i) {
    EncodeCone(parts[i], i, &nodes_[index]);
    EncodeMean(parts[i], i, &nodes_[index]);
  }
  if (splits_) {
    energies_.emplace_back();
    for (size_t i = 0; i < count; ++i) MeasureEnergies(parts[i], i, &energies_[index]);
  }
  nodes_[index].parent = parent;
  float sum = 0;
  for (size_t i = 0; i < count; ++i) {
    const LightEntry& first = entries_[parts[i].begin];
    const uint32_t slot = index * static_cast<uint32_t>(kWidth) + static_cast<uint32_t>(i);
    float intensity = first.intensity;
    uint32_t child = first.light | kLightBit;
    if (parts[i].size() == 1) {
      tree_.slot_of_light_[first.light] = slot;
    } else {
      child = static_cast<uint32_t>(nodes_.size());
      intensity = BuildNode(parts[i], slot, level + 1);
    }
    nodes_[index].child[i] = child;
    nodes_[index].intensity[i] = intensity;
    sum += intensity;
  }
  return sum;
}

// The nodes in the tree's order: first those with slots of visibility, then the rest as built. From
// the root down, the next one is the brightest child of those before.
std::vector<uint32_t> LightTree::Builder::BrightestFirst() const {
  struct Candidate {
    float intensity;
    uint32_t index;
  };
  std::vector<Candidate> candidates = {{0, 0}};
  std::vector<uint32_t> order;
  order.reserve(nodes_.size());
  std::vector<bool> is_first(nodes_.size());
  while (!candidates.empty() && order.size() < kVisibilityNodesMax) {
    const auto brightest = std::max_element(
        candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
          return a.intensity != b.intensity ? a.intensity < b.intensity : a.index > b.index;
        });
    const uint32_t index = brightest->index;
    candidates.erase(brightest);
    order.push_back(index);
    is_first[index] = true;
    const Node& node = nodes_[index];
    for (size_t i = 0; i < kWidth; ++i) {
      if (!(node.intensity[i] > 0) || (node.child[i] & kLightBit) != 0) continue;
      candidates.push_back({node.intensity[i], node.child[i]});
    }
  }
  for (uint32_t i = 0; i < nodes_.size(); ++i) {
    if (!is_first[i]) order.push_back(i);
  }
  return order;
}

// Fills the tree with the nodes in the order.
void LightTree::Builder::MoveNodes(const std::vector<uint32_t>& order) {
  std::vector<uint32_t> place_of(order.size());
  for (uint32_t i = 0; i < order.size(); ++i) place_of[order[i]] = i;
  const auto moved = [&](uint32_t slot) -> uint32_t {
    constexpr auto kPlaces = static_cast<uint32_t>(kWidth);
    return slot == kNoSlot ? kNoSlot : place_of[slot / kPlaces] * kPlaces + slot % kPlaces;
  };
  for (const uint32_t index : order) {
    Node node = nodes_[index];
    node.parent = moved(node.parent);
    for (size_t i = 0; i < kWidth; ++i) {
      const bool is_node = node.intensity[i] > 0 && (node.child[i] & kLightBit) == 0;
      if (is_node) node.child[i] = place_of[node.child[i]];
    }
    tree_.nodes_.push_back(node);
    if (splits_) tree_.energies_.push_back(energies_[index]);
  }
  for (uint32_t& slot : tree_.slot_of_light_) slot = moved(slot);
}

// Splits (*parts)[0] into up to kWidth parts, in order. Returns their number.
size_t LightTree::Builder::SplitInto(std::array<Part, kWidth>* parts, bool by_cost) {
  const Part whole = (*parts)[0];
  if (whole.size() <= kWidth) {
    for (size_t i = 0; i < whole.size(); ++i) {
      (*parts)[i] = PartOf(whole.begin + i, whole.begin + i + 1);
    }
    return whole.size();
  }
  size_t count = 1;
  while (count < kWidth) {
    // The costliest part that can be split; of equals, the largest.
    Part* costliest = nullptr;
    for (Part* part = parts->data(); part != parts->data() + count; ++part) {
      if (part->size() == 1) continue;
      if (costliest == nullptr || part->cost > costliest->cost ||
          (part->cost == costliest->cost && part->size() > costliest->size())) {
        costliest = part;
      }
    }
    if (costliest == nullptr) break;
    Part left, right;
    if (!by_cost || !SplitByCost(*costliest, &left, &right)) {
      const size_t middle = costliest->begin + costliest->size() / 2;
      left = PartOf(costliest->begin, middle);
      right = PartOf(middle, costliest->end);
    }
    left.cost = by_cost ? left.cluster.Cost(orientation_) : 0;
    right.cost = by_cost ? right.cluster.Cost(orientation_) : 0;
    *costliest = left;
    std::move_backward(costliest + 1, parts->data() + count, parts->data() + count + 1);
    costliest[1] = right;
    ++count;
  }
  return count;
}

// Returns false where all centers coincide: then no plane separates them.
bool LightTree::Builder::SplitByCost(const Part& part, Part* left, Part* right) {
  const LightCluster& all = part.cluster;
  const Intervals intervals[3] = {{all, 0}, {all, 1}, {all, 2}};
  std::array<std::array<LightCluster, kIntervalCount>, 3> clusters;
  for (size_t i = part.begin; i < part.end; ++i) {
    for (const Intervals& along : intervals) {
      if (along.IsUsable()) clusters[along.axis][along.Of(entries_[i])].Add(entries_[i]);
    }
  }
  const Vec3f extent = all.upper - all.lower;
  const float longest = std::max({extent.x, extent.y, extent.z});
  float least_cost = 0;
  const Intervals* best = nullptr;
  size_t best_first_right = 0;
  for (const Intervals& along : intervals) {
    if (!along.IsUsable()) continue;
    const std::array<LightCluster, kIntervalCount>& cluster = clusters[along.axis];
    std::array<LightCluster, kIntervalCount> from;  // Interval i and all above it.
    from.back() = cluster.back();
    for (size_t i = kIntervalCount - 1; i-- > 0;) {
      from[i] = from[i + 1];
      from[i].Add(cluster[i]);
    }
    LightCluster below;
    for (size_t i = 1; i < kIntervalCount; ++i) {
      below.Add(cluster[i - 1]);
      if (below.count == 0 || from[i].count == 0) continue;
      // Discourages splits that make thin boxes thinner.
      const float cost =
          longest / extent[along.axis] * (below.Cost(orientation_) + from[i].Cost(orientation_));
      if (best != nullptr && !(cost < least_cost)) continue;
      least_cost = cost;
      best = &along;
      best_first_right = i;
      left->cluster = below;
      right->cluster = from[i];
    }
  }
  if (best == nullptr) return false;
  const auto begin = entries_.begin() + static_cast<ptrdiff_t>(part.begin);
  const auto end = entries_.begin() + static_cast<ptrdiff_t>(part.end);
  const auto middle = std::stable_partition(
      begin, end, [&](const LightEntry& entry) { return best->Of(entry) < best_first_right; });
  left->begin = part.begin;
  left->end = right->begin = static_cast<size_t>(middle - entries_.begin());
  right->end = part.end;
  return true;
}

// Rounds outward, except for float rounding, which a walk allows for.
void LightTree::Builder::EncodeBoxes(const std::array<Part, kWidth>& parts, size_t count,
                                     Node* node) {
  LightCluster all;
  for (size_t i = 0; i < count; ++i) all.Add(parts[i].cluster);
  node->origin = all.lower;
  node->step = (all.upper - all.lower) / 255;
  for (size_t axis = 0; axis < 3; ++axis) {
    const float origin = node->origin[axis], step = node->step[axis];
    if (!(step > 0)) continue;
    for (size_t i = 0; i < count; ++i) {
      const float lower = parts[i].cluster.lower[axis], upper = parts[i].cluster.upper[axis];
      const float middle = std::floor((0.5f * lower + 0.5f * upper - origin) / step + 0.5f);
      const auto center = static_cast<uint16_t>(std::clamp(middle, 0.0f, 255.0f));
      const float decoded = origin + step * static_cast<float>(center);
      const float half = std::ceil(std::max(upper - decoded, decoded - lower) / step);
      node->box[axis][i] = static_cast<uint16_t>(
          center + 256 * static_cast<uint16_t>(std::clamp(half, 0.0f, 255.0f)));
    }
  }
}

// The cone about the mean normal that contains every normal; all directions where the mean is zero
// or a light has no normal.
void LightTree::Builder::EncodeCone(const Part& part, size_t place, Node* node) const {
  const Vec3f sum = part.cluster.normal_sum;
  const float length = Length(sum);
  const Vec3f axis = length > 0 && std::isfinite(length) ? sum / length : Vec3f{0, 0, 1};
  bool two_sided = false;
  for (size_t i = part.begin; i < part.end; ++i) two_sided |= entries_[i].two_sided;
  float cos_normals = 1, cos_emission = 1;
  for (size_t i = part.begin; i < part.end; ++i) {
    const LightEntry& entry = entries_[i];
    const float along = Dot(axis, entry.normal);
    const bool has_normal = entry.normal != Vec3f{};
    // If any light is two-sided, angles are those of undirected lines; bounds of one-sided lights
    // only widen.
    cos_normals =
        std::min(cos_normals, has_normal ? (two_sided ? std::fabs(along) : along) : -1.0f);
    cos_emission = std::min(cos_emission, entry.cos_emission);
  }
  for (size_t i = 0; i < 3; ++i) {
    node->axis[i][place] = static_cast<int16_t>(std::floor(axis[i] * kAxisSteps + 0.5f));
  }
  const float cosine =
      std::max(std::floor((cos_normals - kNodeConeSlack) * kAxisSteps), -kAxisSteps);
  node->cos_normals[place] = static_cast<int16_t>(cosine);
  node->sin_normals[place] =
      static_cast<int16_t>(std::sqrt((kAxisSteps - cosine) * (kAxisSteps + cosine)));
  node->emission[place] = static_cast<uint16_t>(
      (two_sided ? 256 : 0) +
      static_cast<int>(std::clamp(std::floor(cos_emission * kEmissionSteps), 0.0f, 255.0f)));
}

// Rounds to nearest: only estimates use the value.
void LightTree::Builder::EncodeMean(const Part& part, size_t place, Node* node) const {
  float even = 0, by_cosine = 0;  // Intensities.
  Vec3f normal_sum{};
  for (size_t i = part.begin; i < part.end; ++i) {
    const LightEntry& entry = entries_[i];
    (entry.by_cosine ? by_cosine : even) += entry.intensity;
    if (entry.by_cosine) normal_sum += entry.normal * entry.intensity;
  }
  const float length = by_cosine > 0 ? Length(normal_sum) / by_cosine : 0;
  const auto in_steps = [](float share) {
    return static_cast<int>(std::clamp(share * kMeanSteps + 0.5f, 0.0f, kMeanSteps));
  };
  node->mean[place] =
      static_cast<uint16_t>(in_steps(length) + 256 * in_steps(even / (even + by_cosine)));
}

void LightTree::Builder::MeasureEnergies(const Part& part, size_t place,
                                         NodeEnergies* energies) const {
  double sum = 0, squares = 0;
  for (size_t i = part.begin; i < part.end; ++i) {
    const double intensity = static_cast<double>(entries_[i].intensity);
    sum += intensity;
    squares += intensity * intensity;
  }
  energies->count[place] = static_cast<float>(part.size());
  energies->square[place] = static_cast<float>(squares / (sum * sum));
}

}  // namespace sheaf::render
