// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/plan/specular_surfaces.h"

#include <algorithm>
#include <variant>

#include "absl/strings/str_cat.h"
#include "common/scene/settings/ray_visibility_check.h"

namespace sheaf::render {
namespace {

// Above this roughness no surface is smooth, whatever its map from roughness to GGX widths.
constexpr float kSmoothRoughnessMax = 0.04f;

bool MayBeSmooth(const FloatInput& roughness) {
  return roughness.texture != kNone || roughness.value <= kSmoothRoughnessMax;
}
bool MayBeSmooth(const RoughnessInput& roughness) {
  return MayBeSmooth(roughness.u) && MayBeSmooth(roughness.v);
}
bool MayBePositive(const FloatInput& input) { return input.texture != kNone || input.value > 0; }

template <typename Material>
bool MayBeSpecular(const Material&) {
  return false;
}
bool MayBeSpecular(const ConductorMaterial& m) { return MayBeSmooth(m.roughness); }
bool MayBeSpecular(const DielectricMaterial& m) { return MayBeSmooth(m.roughness); }
bool MayBeSpecular(const SubsurfaceMaterial& m) { return MayBeSmooth(m.roughness); }
bool MayBeSpecular(const ThinDielectricMaterial&) { return true; }
bool MayBeSpecular(const CoatedConductorMaterial& m) {
  return MayBeSmooth(m.roughness) && MayBeSmooth(m.conductor.roughness);
}
bool MayBeSpecular(const PrincipledMaterial& m) {
  return MayBeSmooth(m.roughness) && (MayBePositive(m.metallic) || MayBePositive(m.transmission));
}

bool MayBeSpecular(const MaterialDescription& description) {
  return std::visit([](const auto& m) { return MayBeSpecular(m); }, description.material);
}

// Named in a note; the others are counted.
constexpr int kMaterialsNamedMax = 3;

// `before`, and the locations of the materials of which that is true in brackets; empty if there
// are none.
template <typename IsOne>
std::string Listed(const SceneDescription& scene, const char* before, const IsOne& is_one) {
  std::string note;
  int count = 0;
  for (const MaterialDescription& description : scene.materials) {
    if (!is_one(description) || ++count > kMaterialsNamedMax) continue;
    absl::StrAppend(&note, count == 1 ? absl::StrCat(before, " (") : ", ",
                    FormatLocation(scene, description.location));
  }
  if (count > kMaterialsNamedMax) {
    absl::StrAppend(&note, " and ", count - kMaterialsNamedMax, " more");
  }
  return count == 0 ? note : note + ")";
}

// The materials at which views share less, as the end of a note; empty if there are none.
std::string LessSharedMaterials(const SceneDescription& scene) {
  return Listed(scene,
                "; those with two rough surfaces or more behind up to 4 mirrors and smooth glasses",
                [](const MaterialDescription& m) { return MayBeSpecular(m); }) +
         Listed(scene, "; none at hair", [](const MaterialDescription& m) {
           return std::holds_alternative<HairMaterial>(m.material);
         });
}

}  // namespace

bool MayHaveSpecularSurfaces(const SceneDescription& scene) {
  return std::ranges::any_of(scene.materials, [](const MaterialDescription& description) {
    return MayBeSpecular(description);
  });
}

bool MayHaveGlossySurfaces(const SceneDescription& scene) {
  const auto may_be_rough = [](const RoughnessInput& roughness) {
    return MayBePositive(roughness.u) || MayBePositive(roughness.v);
  };
  return std::ranges::any_of(scene.materials, [&](const MaterialDescription& description) {
    if (const auto* m = std::get_if<CoatedConductorMaterial>(&description.material)) {
      return may_be_rough(m->roughness) || may_be_rough(m->conductor.roughness);
    }
    if (const auto* m = std::get_if<PrincipledMaterial>(&description.material)) {
      const bool is_glass = m->transmission.texture == kNone && m->transmission.value > 0 &&
                            m->metallic.texture == kNone && m->metallic.value < 1;
      return !is_glass && (MayBePositive(m->roughness) ||
                           (MayBePositive(m->coat) && MayBePositive(m->coat_roughness)));
    }
    const auto* const metal = std::get_if<ConductorMaterial>(&description.material);
    const auto* const coated = std::get_if<CoatedDiffuseMaterial>(&description.material);
    return (metal != nullptr && may_be_rough(metal->roughness)) ||
           (coated != nullptr && may_be_rough(coated->roughness));
  });
}

std::string StereoNote(const SceneDescription& scene) {
  return absl::StrCat("stereo: both eyes share the paths that begin at rough surfaces",
                      LessSharedMaterials(scene));
}

std::string SharingNote(const SceneDescription& scene, bool by_views, bool world_moves) {
  const CameraDescription& camera = scene.camera;
  const std::string note = "sharing: paths count in all pixels whose filters cover them";
  if (!by_views) return note;
  const char* const still =
      world_moves ? "; times of the shutter share none, as more than the camera moves" : "";
  const bool through_lens = camera.IsRealistic() || camera.lens_radius > 0;
  const bool camera_moves =
      camera.world_from_camera.IsAnimated() && camera.shutter_close > camera.shutter_open;
  const bool over_shutter = camera_moves && !world_moves;
  if (!through_lens && !over_shutter) {
    return absl::StrCat(note, "; views: none share paths, as the camera has no lens and ",
                        camera_moves ? "is not all that moves" : "does not move",
                        camera_moves ? "" : still);
  }
  return absl::StrCat(
      note, "; views: up to 8 points of the ", through_lens ? "lens" : "",
      through_lens && over_shutter ? " and the " : "", over_shutter ? "shutter" : "",
      " share the paths that begin at rough surfaces", LessSharedMaterials(scene), still);
}

void NoteSharedPaths(const SceneDescription& scene, const FrameSettings& settings, bool world_moves,
                     std::vector<std::string>* notes) {
  if (FirstInvisible(scene) != nullptr) {
    notes->emplace_back(
        "ray visibility: paths begin at the camera alone, each for one pixel; light paths, sharing "
        "and mutations are off, as they do not know the kinds of their rays");
  }
  if (settings.IsStereo()) notes->push_back(StereoNote(scene));
  if (!SharesPaths(settings.techniques)) return;
  notes->push_back(SharingNote(scene, SharesViews(settings.techniques), world_moves));
}

}  // namespace sheaf::render
