// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/extensions.h"

#include <algorithm>
#include <iterator>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/scene/gltf/draco_primitives.h"
#include "common/scene/gltf/meshopt_views.h"
#include "common/scene/gltf/values.h"

namespace sheaf::gltf {
namespace {

constexpr const char* kKnownExtensions[] = {
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "EXT_texture_webp",
    kInstancing,
    kDraco,
    kMeshopt,
    kMeshoptKhr,
};
// Those that have messages of their own where they are used.
constexpr const char* kNamedElsewhere[] = {"KHR_texture_basisu"};
// Those whose files have all that is needed without them, even if they call them required: the
// shaders of KHR_techniques_webgl stand beside materials of the core format, metadata is not
// seen, and an origin (CESIUM_RTC) moves the file as a whole.
constexpr const char* kChoices[] = {"KHR_materials_variants", "KHR_techniques_webgl",
                                    "EXT_structural_metadata", "CESIUM_RTC"};

template <typename List>
bool Contains(const List& list, const std::string& name) {
  return std::any_of(std::begin(list), std::end(list),
                     [&](const char* known) { return name == known; });
}

}  // namespace

void CheckExtensions(const tinygltf::Model& model, Diagnostics* diagnostics) {
  std::vector<std::string> needed;
  for (const std::string& name : model.extensionsUsed) {
    if (Contains(kKnownExtensions, name) || Contains(kNamedElsewhere, name)) continue;
    const auto& required = model.extensionsRequired;
    if (std::find(required.begin(), required.end(), name) == required.end() ||
        Contains(kChoices, name)) {
      diagnostics->Note(kFile, absl::StrCat("the extension ", name, " has no effect"));
    } else {
      needed.push_back(name);
    }
  }
  if (needed.empty()) return;
  diagnostics->Error(kFile, absl::StrCat("needs the extension", needed.size() == 1 ? " " : "s ",
                                         absl::StrJoin(needed, " and "),
                                         ", which Sheaf does not support; export it without"));
}

}  // namespace sheaf::gltf
