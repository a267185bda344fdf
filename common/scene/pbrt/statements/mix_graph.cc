// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/pbrt/statements/mix_graph.h"

#include <algorithm>
#include <cstddef>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"

namespace sheaf {
namespace {

const MixMaterial* MixOf(const SceneDescription& scene, size_t material) {
  return std::get_if<MixMaterial>(&scene.materials[material].material);
}

class MixGraph {
 public:
  explicit MixGraph(const SceneDescription& scene)
      : scene_(scene),
        unresolved_parts_(scene.materials.size(), 0),
        depth_(scene.materials.size(), 0),
        holders_(scene.materials.size()) {
    for (size_t i = 0; i < scene.materials.size(); ++i) {
      ForEachMixIn(i, [&](size_t part) {
        ++unresolved_parts_[i];
        holders_[part].push_back(i);
      });
    }
  }

  // Levels of mixes of each material, its own included; 0 for those in or above a cycle and for
  // materials that are no mixes. Parts before what holds them: Kahn, "Topological sorting of large
  // networks" (1962).
  const std::vector<uint32_t>& Depths() {
    std::vector<size_t> resolved;
    for (size_t i = 0; i < depth_.size(); ++i) {
      if (MixOf(scene_, i) != nullptr && unresolved_parts_[i] == 0) resolved.push_back(i);
    }
    while (!resolved.empty()) {
      const size_t part = resolved.back();
      resolved.pop_back();
      uint32_t below = 0;
      ForEachMixIn(part, [&](size_t inner) { below = std::max(below, depth_[inner]); });
      depth_[part] = below + 1;
      for (const size_t holder : holders_[part]) {
        if (--unresolved_parts_[holder] == 0) resolved.push_back(holder);
      }
    }
    return depth_;
  }

  // Materials of one cycle, the one that comes first in the scene at the front; empty without a
  // cycle. Requires: Depths().
  std::vector<size_t> Cycle() const {
    const auto first = std::find_if(unresolved_parts_.begin(), unresolved_parts_.end(),
                                    [](uint32_t parts) { return parts > 0; });
    if (first == unresolved_parts_.end()) return {};
    // Each unresolved mix has an unresolved part, so following them leads into a cycle.
    std::vector<size_t> path;
    std::vector<bool> is_on_path(depth_.size(), false);
    auto at = static_cast<size_t>(first - unresolved_parts_.begin());
    while (!is_on_path[at]) {
      is_on_path[at] = true;
      path.push_back(at);
      ForEachMixIn(path.back(), [&](size_t part) {
        if (unresolved_parts_[part] > 0) at = part;
      });
    }
    path.erase(path.begin(), std::find(path.begin(), path.end(), at));
    std::rotate(path.begin(), std::min_element(path.begin(), path.end()), path.end());
    return path;
  }

 private:
  template <typename Visit>
  void ForEachMixIn(size_t material, const Visit& visit) const {
    const MixMaterial* const mix = MixOf(scene_, material);
    if (mix == nullptr) return;
    for (const int32_t part : mix->material) {
      if (part == kNone) continue;
      if (MixOf(scene_, static_cast<size_t>(part)) != nullptr) visit(static_cast<size_t>(part));
    }
  }

  const SceneDescription& scene_;
  std::vector<uint32_t> unresolved_parts_;  // Mixes of each mix whose depth is unknown.
  std::vector<uint32_t> depth_;
  std::vector<std::vector<size_t>> holders_;
};

}  // namespace

void CheckMixes(const SceneDescription& scene, uint32_t depth_max, Diagnostics* diagnostics) {
  MixGraph graph(scene);
  const std::vector<uint32_t>& depths = graph.Depths();
  if (const std::vector<size_t> cycle = graph.Cycle(); !cycle.empty()) {
    const MaterialDescription& first = scene.materials[cycle.front()];
    diagnostics->Error(first.location,
                       absl::StrCat("the mix material \"", first.name, "\" contains itself"));
  }
  const auto deep =
      std::find_if(depths.begin(), depths.end(), [&](uint32_t depth) { return depth > depth_max; });
  if (deep == depths.end()) return;
  diagnostics->Error(
      scene.materials[static_cast<size_t>(deep - depths.begin())].location,
      absl::StrCat("mix materials are nested ", *deep, " deep, more than the limit of ", depth_max,
                   " (mix_depth_max); mix fewer materials"));
}

}  // namespace sheaf
