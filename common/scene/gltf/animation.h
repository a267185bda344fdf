// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Animations: poses of the nodes at a time (glTF 2.0 specification, sec. 3.11 and appendix C).
#pragma once

#include "common/scene/gltf/tinygltf_door.h"

#include <string>
#include <vector>

#include "common/scene/gltf/accessors.h"
#include "common/scene/gltf/node_tree.h"
#include "common/scene/gltf/skipped_parts.h"
#include "common/scene/pbrt/syntax/diagnostics.h"

namespace sheaf::gltf {

class Animations {
 public:
  // Reads the animation of this name, or the first with those after it that move other things; says
  // in notes which are left out. Errors are reported. model must outlive this.
  Animations(const tinygltf::Model& model, const std::string& name, Accessors* accessors,
             SkippedParts* skipped, Diagnostics* diagnostics);

  bool IsEmpty() const { return channels_.empty(); }
  // The poses with those values replaced that move. Before its first key and after its last one a
  // value stays.
  std::vector<Pose> At(double time_s, const std::vector<Pose>& poses) const;

 private:
  enum class Path { kTranslation, kRotation, kScale, kWeights };
  enum class Interpolation { kStep, kLinear, kCubic };
  struct Channel {
    size_t node = 0;
    Path path = Path::kTranslation;
    Interpolation interpolation = Interpolation::kLinear;
    size_t width = 3;            // Numbers of a value.
    std::vector<float> times_s;  // Ascending.
    std::vector<float> values;   // width for each time; for kCubic in-tangent, value, out-tangent.
  };

  bool Add(const tinygltf::Animation& animation, const tinygltf::AnimationChannel& channel,
           const std::string& what);
  bool AddKeys(const tinygltf::AnimationSampler& sampler, const std::string& what,
               Channel* channel);
  static std::vector<double> ValueAt(const Channel& channel, double time_s);

  const tinygltf::Model* model_;
  Accessors* accessors_;
  SkippedParts* skipped_;
  Diagnostics* diagnostics_;
  std::vector<Channel> channels_;
};

}  // namespace sheaf::gltf
