// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of SceneBuilder that handles media. A file may use a medium before it defines it.
#include <algorithm>
#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/scene/pbrt/constant_grid.h"
#include "common/scene/pbrt/scene_builder.h"
#include "common/scene/pbrt/statements/medium_parameters.h"
#include "common/scene/pbrt/statements/option_parameters.h"

namespace sheaf {

int32_t SceneBuilder::MediumSlot(const std::string& name, SourceLocation location) {
  if (name.empty()) return kNone;
  const auto [entry, is_new] = media_.emplace(name, static_cast<int32_t>(scene_->media.size()));
  if (is_new) {
    MediumDescription& medium = scene_->media.emplace_back();
    medium.name = name;
    medium.location = location;
    medium_uses_.emplace_back();
  }
  return entry->second;
}

void SceneBuilder::MediumInterface(const std::string& inside, const std::string& outside,
                                   SourceLocation location) {
  state_.media = {MediumSlot(inside, location), MediumSlot(outside, location)};
  for (const int32_t medium : {state_.media.inside, state_.media.outside}) {
    if (medium != kNone) medium_uses_[static_cast<size_t>(medium)].is_used = true;
  }
}

void SceneBuilder::MakeNamedMedium(const std::string& name, std::vector<Parameter> own,
                                   SourceLocation location) {
  const int32_t index = MediumSlot(name, location);
  if (index == kNone) {
    diagnostics_->Error(location, "a medium needs a name");
    return;
  }
  MediumUse& use = medium_uses_[static_cast<size_t>(index)];
  MediumDescription& medium = scene_->media[static_cast<size_t>(index)];
  if (use.is_made) {
    diagnostics_->Error(location,
                        absl::StrCat("medium \"", name, "\" is defined twice; the first is at ",
                                     FormatLocation(*scene_, medium.location)));
    return;
  }
  use.is_made = true;
  medium.location = location;
  ParameterList parameters =
      Parameters(absl::StrCat("medium \"", name, "\""), "medium", std::move(own), location);
  if (state_.IsAnimated()) {
    diagnostics_->Warning(location, "media do not move; the transformation at the start is used");
  }
  SetMedium(state_.start, parameters, *files_, &medium);
}

void SceneBuilder::FinishSubsurface() {
  const auto first = static_cast<int32_t>(scene_->media.size());
  const std::vector<MediumDescription>& media = materials_.subsurface();
  if (media.empty()) return;
  scene_->media.insert(scene_->media.end(), media.begin(), media.end());
  for (MaterialDescription& material : scene_->materials) {
    auto* subsurface = std::get_if<SubsurfaceMaterial>(&material.material);
    if (subsurface != nullptr) subsurface->medium += first;
  }
  for (ShapeDescription& shape : scene_->shapes) {
    if (shape.material == kNone) continue;
    const MaterialDescription& material = scene_->materials[static_cast<size_t>(shape.material)];
    const auto* subsurface = std::get_if<SubsurfaceMaterial>(&material.material);
    if (subsurface == nullptr) continue;
    if (std::holds_alternative<CurveShape>(shape.shape)) {
      diagnostics_->Error(shape.location,
                          "curves have no inside; give them a material other than subsurface");
    }
    if (shape.media.inside != shape.media.outside && shape.media.inside != kNone) {
      diagnostics_->Warning(shape.location,
                            "the medium inside has no effect: the shape's material is subsurface");
    }
    shape.media.inside = subsurface->medium;
  }
}

void SceneBuilder::FinishMedia() {
  std::vector<std::string> names;
  for (const MediumDescription& medium : scene_->media) names.push_back(medium.name);
  for (size_t i = 0; i < scene_->media.size(); ++i) {
    const MediumDescription& medium = scene_->media[i];
    if (!medium_uses_[i].is_made) {
      names.erase(std::find(names.begin(), names.end(), medium.name));
      diagnostics_->Error(medium.location,
                          absl::StrCat("medium \"", medium.name, "\" is used here but not defined",
                                       NearestNameHint(medium.name, names)));
    } else if (!medium_uses_[i].is_used) {
      diagnostics_->Note(medium.location, absl::StrCat("medium \"", medium.name,
                                                       "\" has no effect: nothing uses it"));
    }
  }
  const std::string& integrator = scene_->sampling.integrator;
  if (scene_->media.empty() || !IntegratorIgnoresMedia(integrator)) {
    FinishSubsurface();
    if (!IntegratorIgnoresMedia(integrator)) FinishPrincipledMedia();
    if (!diagnostics_->HasErrors()) ConvertConstantGrids(scene_);
    return;
  }
  diagnostics_->Warning(scene_->media[0].location,
                        absl::StrCat("media have no effect: the integrator \"", integrator,
                                     "\" ignores them, as in pbrt-v4"));
  scene_->media.clear();
  scene_->camera.medium = kNone;
  for (ShapeDescription& shape : scene_->shapes) shape.media = {};
  FinishSubsurface();
}

}  // namespace sheaf
