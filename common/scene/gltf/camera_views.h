// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Cameras of a glTF file, and one of our own for files without (glTF 2.0 specification, sec. 3.10).
#pragma once

#include "common/scene/gltf/tinygltf_door.h"

#include <vector>

#include "common/math/transform.h"
#include "common/scene/gltf/gltf_view.h"
#include "common/scene/pbrt/syntax/diagnostics.h"
#include "common/scene/scene_description.h"

namespace sheaf::gltf {

struct Bounds {
  Vec3d lower{1e300, 1e300, 1e300}, upper{-1e300, -1e300, -1e300};
  void Add(Vec3d p);
  bool IsEmpty() const { return lower.x > upper.x; }
};

// Sets camera and film for the view: the camera that it names, else the first that is shown, else
// one that looks at all of `bounds`, with a note. start and end: world matrices of the nodes when
// the shutter opens and closes. If the view has a camera for the right eye, the camera is halfway
// between both; returns their distance in the camera's space, otherwise 0. Both must look in the
// same direction from places beside each other, since the eyes of a stereo frame do.
float SetCameraOf(const tinygltf::Model& model, const std::vector<int>& shown, const GltfView& view,
                  const std::vector<Matrix4>& start, const std::vector<Matrix4>& end,
                  const Bounds& bounds, Diagnostics* diagnostics, SceneDescription* scene);

}  // namespace sheaf::gltf
