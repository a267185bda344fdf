// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MatteNames: the names of a scene's objects and materials in mattes. Scenes give them ("string
// name"); other things get one that depends on no line of the file, so that an edited scene keeps
// its mattes:
//
//   shape     "wood.sphere#2": its material's name, or type, its kind, and its number among equals
//   instance  "tree#3": its object's name, and its number among the instances of the object
//   material  "diffuse#2": its type, and its number among the unnamed ones of the type
//
// Names that the scene gives to several things make one matte of them. A number whose name, or
// whose id, is taken is left out.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "common/scene/scene_description.h"

namespace sheaf::render {

class MatteNames {
 public:
  MatteNames() = default;
  explicit MatteNames(const SceneDescription& scene);

  // Requires: scene is that of the constructor; the shape is of no object.
  std::string OfShape(const SceneDescription& scene, size_t shape) const;
  std::string OfInstance(const SceneDescription& scene, size_t instance) const;
  std::string OfMaterial(const SceneDescription& scene, size_t material) const;

 private:
  // From 1; 0 where the scene gives the name.
  std::vector<uint32_t> number_of_shape_, number_of_instance_, number_of_material_;
};

// A line for each pair of names of the scene that have one id, and are therefore one matte; at most
// kMatteCollisionsShown.
inline constexpr size_t kMatteCollisionsShown = 8;
std::vector<std::string> MatteCollisions(const SceneDescription& scene);

}  // namespace sheaf::render
