// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Lights of KHR_lights_punctual. Its units are photometric: candelas for points and spots, lux for
// distant lights. Values of images then are candelas per square meter, if the file's unit is the
// meter: radiance of 1 in Sheaf's RGB stands for a luminance of 1 cd/m^2.
#pragma once

#include "common/scene/gltf/tinygltf_door.h"

#include <string>

#include "common/math/transform.h"
#include "common/scene/file_source.h"
#include "common/scene/gltf/skipped_parts.h"
#include "common/scene/pbrt/syntax/diagnostics.h"
#include "common/scene/scene_description.h"

namespace sheaf::gltf {

// Adds the light of a node, if it has one, to the scene. Mistakes are reported.
void AddLightOf(const tinygltf::Model& model, int node, const TransformOverTime& place,
                SkippedParts* skipped, Diagnostics* diagnostics, SceneDescription* scene);

// Adds the view's environment, or where the file has no lights of its own, that of surrounding.h,
// with a note: what emits is seldom meant to light the scene alone. environment: as
// GltfView::environment. A uniform white one where the files have no map for it, as in jobs that
// earlier versions submitted.
void AddEnvironment(const std::string& environment, const std::string& main_file, FileSource* files,
                    Diagnostics* diagnostics, SceneDescription* scene);

}  // namespace sheaf::gltf
