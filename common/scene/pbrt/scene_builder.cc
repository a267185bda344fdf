// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/pbrt/scene_builder.h"

#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/scene/pbrt/principled_media.h"
#include "common/scene/pbrt/statements/color_parameters.h"
#include "common/scene/pbrt/statements/light_parameters.h"
#include "common/scene/pbrt/statements/subsurface_reflectance.h"

namespace sheaf {
namespace {

// Maximum nesting depth of blocks; each keeps a copy of the graphics state.
constexpr size_t kBlocksMax = 4096;

std::string_view BeginOf(int kind) {
  static constexpr std::string_view kNames[] = {"AttributeBegin", "TransformBegin", "ObjectBegin",
                                                "Import"};
  return kNames[kind];
}

Matrix4 MatrixFromColumns(const double* numbers) {
  Matrix4 matrix;
  for (size_t row = 0; row < 4; ++row) {
    for (size_t column = 0; column < 4; ++column) matrix.m[row][column] = numbers[4 * column + row];
  }
  return matrix;
}

}  // namespace

SceneBuilder::SceneBuilder(SceneDescription* scene, SceneFiles* files, Diagnostics* diagnostics,
                           const SceneReaderLimits& limits)
    : scene_(scene),
      files_(files),
      diagnostics_(diagnostics),
      memory_bytes_max_(limits.memory_bytes_max),
      textures_(scene, files, diagnostics),
      materials_(scene, &textures_, files, diagnostics, limits.mix_depth_max),
      shapes_(scene, &textures_, files, diagnostics, limits) {
  scene_->sampling.sampler = "zsobol";
  scene_->sampling.integrator = "volpath";
}

int32_t SceneBuilder::AddFile(const std::string& canonical_name) {
  const auto [known, is_new] =
      file_indices_.emplace(canonical_name, static_cast<int32_t>(scene_->files.size()));
  if (is_new) scene_->files.push_back(canonical_name);
  return known->second;
}

// --- Transformations ---------------------------------------------------------------------------

bool SceneBuilder::RequireFinite(const double* numbers, size_t count, SourceLocation location) {
  // Beyond this, products of a few transformations overflow.
  constexpr double kMagnitudeMax = 1e30;
  for (size_t i = 0; i < count; ++i) {
    if (std::fabs(numbers[i]) <= kMagnitudeMax) continue;
    diagnostics_->Error(location,
                        absl::StrCat("number ", i + 1, " of the transformation is too large"));
    return false;
  }
  return true;
}

void SceneBuilder::Concatenate(const Matrix4& matrix) {
  if (state_.start_is_active) state_.start = state_.start * matrix;
  if (state_.end_is_active) state_.end = state_.end * matrix;
}

void SceneBuilder::Identity(const double* /*numbers*/, SourceLocation /*location*/) {
  if (state_.start_is_active) state_.start = Matrix4();
  if (state_.end_is_active) state_.end = Matrix4();
}

void SceneBuilder::Translate(const double* n, SourceLocation location) {
  if (RequireFinite(n, 3, location)) Concatenate(TranslateMatrix({n[0], n[1], n[2]}));
}

void SceneBuilder::Scale(const double* n, SourceLocation location) {
  if (RequireFinite(n, 3, location)) Concatenate(ScaleMatrix({n[0], n[1], n[2]}));
}

void SceneBuilder::Rotate(const double* n, SourceLocation location) {
  if (!RequireFinite(n, 4, location)) return;
  const Vec3d axis{n[1], n[2], n[3]};
  if (!(LengthSquared(axis) > 0)) {
    diagnostics_->Error(location, "Rotate about a zero axis; give an axis such as 0 1 0");
    return;
  }
  Concatenate(RotateMatrix(n[0], axis));
}

void SceneBuilder::LookAt(const double* n, SourceLocation location) {
  if (!RequireFinite(n, 9, location)) return;
  Matrix4 world_from_camera, camera_from_world;
  if (!LookAtMatrix({n[0], n[1], n[2]}, {n[3], n[4], n[5]}, {n[6], n[7], n[8]},
                    &world_from_camera) ||
      !Invert(world_from_camera, &camera_from_world)) {
    diagnostics_->Error(location,
                        "LookAt gives no direction: eye and target coincide, or up points "
                        "along the view");
    return;
  }
  Concatenate(camera_from_world);
}

void SceneBuilder::Transform(const double* n, SourceLocation location) {
  if (!RequireFinite(n, 16, location)) return;
  if (state_.start_is_active) state_.start = MatrixFromColumns(n);
  if (state_.end_is_active) state_.end = MatrixFromColumns(n);
}

void SceneBuilder::ConcatTransform(const double* n, SourceLocation location) {
  if (RequireFinite(n, 16, location)) Concatenate(MatrixFromColumns(n));
}

void SceneBuilder::TransformTimes(const double* n, SourceLocation location) {
  if (!RequireOptions("TransformTimes", location)) return;
  if (!(n[0] < n[1])) {
    diagnostics_->Error(location, "TransformTimes needs a start before its end");
    return;
  }
  start_time_ = static_cast<float>(n[0]);
  end_time_ = static_cast<float>(n[1]);
}

bool SceneBuilder::ActiveTransform(std::string_view which) {
  if (which != "StartTime" && which != "EndTime" && which != "All") return false;
  state_.start_is_active = which != "EndTime";
  state_.end_is_active = which != "StartTime";
  return true;
}

void SceneBuilder::CoordinateSystem(const std::string& name, SourceLocation /*location*/) {
  coordinate_systems_[name] = {state_.start, state_.end};
}

void SceneBuilder::CoordSysTransform(const std::string& name, SourceLocation location) {
  const auto found = coordinate_systems_.find(name);
  if (found == coordinate_systems_.end()) {
    std::vector<std::string> names;
    for (const auto& entry : coordinate_systems_) names.push_back(entry.first);
    diagnostics_->Error(location, absl::StrCat("coordinate system \"", name,
                                               "\" is not defined before "
                                               "this line",
                                               NearestNameHint(name, names)));
    return;
  }
  state_.start = found->second.first;
  state_.end = found->second.second;
}

TransformOverTime SceneBuilder::CurrentTransform() const {
  TransformOverTime transform;
  transform.start = state_.start;
  transform.end = state_.end;
  transform.start_time = start_time_;
  transform.end_time = end_time_;
  return transform;
}

// --- Blocks ------------------------------------------------------------------------------------

bool SceneBuilder::RequireWorld(std::string_view directive, SourceLocation location) {
  if (is_world_) return true;
  // Without WorldBegin everything is misplaced; it is reported only once.
  if (!std::exchange(missed_world_, true)) {
    diagnostics_->Error(location,
                        absl::StrCat(std::string(directive), " must stand after WorldBegin"));
  }
  return false;
}

bool SceneBuilder::RequireOptions(std::string_view directive, SourceLocation location) {
  if (!is_world_) return true;
  diagnostics_->Error(location,
                      absl::StrCat(std::string(directive), " must stand before WorldBegin"));
  return false;
}

void SceneBuilder::Push(Block::Kind kind, SourceLocation location) {
  if (blocks_.size() == kBlocksMax) {
    diagnostics_->Error(location,
                        absl::StrCat("blocks are nested deeper than the limit of ", kBlocksMax));
  }
  blocks_.push_back({kind, location, state_, {}});
}

bool SceneBuilder::Pop(Block::Kind kind, std::string_view directive, SourceLocation location) {
  if (blocks_.empty() || blocks_.back().kind != kind) {
    std::string found = "no block is open";
    if (!blocks_.empty()) {
      const Block& open = blocks_.back();
      found = absl::StrCat("the innermost open block is the ",
                           std::string(BeginOf(static_cast<int>(open.kind))), " at ",
                           FormatLocation(*scene_, open.location));
    }
    diagnostics_->Error(location, absl::StrCat(std::string(directive), " ends nothing: ", found));
    return false;
  }
  Block& block = blocks_.back();
  if (kind == Block::Kind::kTransform) {
    state_.start = block.saved.start;
    state_.end = block.saved.end;
  } else {
    state_ = std::move(block.saved);
  }
  if (kind == Block::Kind::kImport) coordinate_systems_ = std::move(block.saved_coordinate_systems);
  blocks_.pop_back();
  return true;
}

void SceneBuilder::ReportOpenBlocks(size_t first) {
  while (blocks_.size() > first) {
    const Block& open = blocks_.back();
    diagnostics_->Error(
        open.location,
        absl::StrCat(std::string(BeginOf(static_cast<int>(open.kind))), " is not closed"));
    if (open.kind == Block::Kind::kObject) open_object_ = kNone;
    Pop(open.kind, "", open.location);
  }
}

void SceneBuilder::WorldBegin(SourceLocation location) {
  if (!RequireOptions("WorldBegin", location)) return;
  is_world_ = true;
  state_.start = state_.end = Matrix4();
  state_.start_is_active = state_.end_is_active = true;
  coordinate_systems_["world"] = {state_.start, state_.end};
}

void SceneBuilder::AttributeBegin(SourceLocation location) {
  if (RequireWorld("AttributeBegin", location)) Push(Block::Kind::kAttribute, location);
}

void SceneBuilder::AttributeEnd(SourceLocation location) {
  if (RequireWorld("AttributeEnd", location))
    Pop(Block::Kind::kAttribute, "AttributeEnd", location);
}

void SceneBuilder::TransformBegin(SourceLocation location) {
  diagnostics_->Note(location, "TransformBegin is an old spelling; pbrt-v4 writes AttributeBegin");
  Push(Block::Kind::kTransform, location);
}

void SceneBuilder::TransformEnd(SourceLocation location) {
  Pop(Block::Kind::kTransform, "TransformEnd", location);
}

void SceneBuilder::ObjectBegin(const std::string& name, SourceLocation location) {
  if (!RequireWorld("ObjectBegin", location)) return;
  if (open_object_ != kNone) {
    diagnostics_->Error(location, "ObjectBegin inside of another object; end that one first");
    return;
  }
  int32_t object = kNone;
  if (!ObjectSlot(name, location, &object)) return;
  if (object_is_defined_[static_cast<size_t>(object)]) {
    const ObjectDefinition& first = scene_->objects[static_cast<size_t>(object)];
    diagnostics_->Error(location,
                        absl::StrCat("object \"", name, "\" is defined twice; the first is at ",
                                     FormatLocation(*scene_, first.location)));
  }
  object_is_defined_[static_cast<size_t>(object)] = true;
  scene_->objects[static_cast<size_t>(object)].location = location;
  Push(Block::Kind::kObject, location);
  open_object_ = object;
}

void SceneBuilder::ObjectEnd(SourceLocation location) {
  if (!RequireWorld("ObjectEnd", location)) return;
  if (Pop(Block::Kind::kObject, "ObjectEnd", location)) open_object_ = kNone;
}

bool SceneBuilder::ImportBegin(SourceLocation location) {
  if (!RequireWorld("Import", location)) return false;
  Push(Block::Kind::kImport, location);
  blocks_.back().saved_coordinate_systems = coordinate_systems_;
  return true;
}

void SceneBuilder::ImportEnd(SourceLocation location) {
  size_t import = blocks_.size();
  while (import > 0 && blocks_[import - 1].kind != Block::Kind::kImport) --import;
  if (import > 0) ReportOpenBlocks(import);
  Pop(Block::Kind::kImport, "Import", location);
}

bool SceneBuilder::ObjectSlot(const std::string& name, SourceLocation location, int32_t* object) {
  if (name.empty()) {
    diagnostics_->Error(location, "an object needs a name");
    return false;
  }
  const auto [entry, is_new] = objects_.emplace(name, static_cast<int32_t>(scene_->objects.size()));
  if (is_new) {
    scene_->objects.push_back({name, {}, location});
    object_is_defined_.push_back(false);
  }
  *object = entry->second;
  return true;
}

void SceneBuilder::EndOfScene() {
  ReportOpenBlocks(0);
  if (!is_world_) {
    diagnostics_->Error({0, 1, 1}, "the scene has no WorldBegin; is this a pbrt-v4 scene file?");
  }
  if (frame_.has_diagonal && !scene_->camera.IsRealistic()) {
    diagnostics_->Note(frame_.diagonal_location,
                       "film: parameter \"diagonal\" has no effect: only realistic cameras have a "
                       "film size");
  }
  SettleFrame(frame_, &scene_->camera, &scene_->film);
  FinishMedia();
  AddPrincipledEmission(scene_, diagnostics_);
  FinishObjects();
  shapes_.ReportSkipped();
  textures_.Finish();
  materials_.Finish();
  if (diagnostics_->HasErrors()) return;
  for (MediumDescription& medium : scene_->media) {
    if (medium.reflectance.has_value()) SetReflectance(*medium.reflectance, &medium);
  }
}

}  // namespace sheaf
