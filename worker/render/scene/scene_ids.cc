// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/scene/scene_ids.h"

#include "absl/strings/str_cat.h"

namespace sheaf::render {
namespace {

constexpr char kMainAsset[] = "scene";

absl::Status CheckCount(size_t count, const char* what) {
  if (count <= kIdMax) return absl::OkStatus();
  return absl::ResourceExhaustedError(
      absl::StrCat("the scene has ", count, " ", what, ", more than the limit of ", kIdMax,
                   " for outputs with ids; render it without --cryptomatte and the AOVs of ids"));
}

}  // namespace

absl::StatusOr<SceneIds> SceneIds::Make(const SceneDescription& scene,
                                        const SceneGeometry& geometry) {
  absl::Status status = CheckCount(scene.shapes.size() + scene.instances.size(), "objects");
  if (status.ok()) status = CheckCount(scene.materials.size(), "materials");
  if (status.ok()) status = CheckCount(scene.files.size() + scene.objects.size() + 1, "assets");
  if (!status.ok()) return status;
  SceneIds ids;
  ids.shape_count_ = static_cast<uint32_t>(scene.shapes.size());
  ids.file_count_ = static_cast<uint32_t>(scene.files.size());
  for (const ShapeDescription& shape : scene.shapes) {
    ids.file_of_shape_.push_back(shape.location.file);
  }
  for (const PlacedGroup& placed : geometry.still) {
    ids.instance_of_placed_.push_back(placed.instance);
  }
  for (const PlacedGroup& placed : geometry.moving) {
    ids.instance_of_placed_.push_back(placed.instance);
  }
  for (const ObjectInstance& instance : scene.instances) {
    ids.object_of_instance_.push_back(instance.object);
  }
  ids.names_ = MatteNames(scene);
  return ids;
}

uint32_t SceneIds::IdOf(IdKind kind, const SurfacePoint& point) const {
  if (kind == IdKind::kMaterial) return static_cast<uint32_t>(point.surface->material + 1);
  const int32_t instance =
      point.id.placed == kNotPlaced ? kNone : instance_of_placed_[point.id.placed];
  const auto shape = static_cast<uint32_t>(point.surface->shape);
  if (kind == IdKind::kObject) {
    return 1 + (instance == kNone ? shape : shape_count_ + static_cast<uint32_t>(instance));
  }
  // Files come first, from kNone for shapes without a location.
  if (instance == kNone) return static_cast<uint32_t>(file_of_shape_[shape] + 2);
  return file_count_ + 2 +
         static_cast<uint32_t>(object_of_instance_[static_cast<size_t>(instance)]);
}

std::string SceneIds::NameOf(IdKind kind, uint32_t id, const SceneDescription& scene) const {
  if (kind == IdKind::kMaterial) return names_.OfMaterial(scene, id - 1);
  if (kind == IdKind::kObject) {
    return id <= shape_count_ ? names_.OfShape(scene, id - 1)
                              : names_.OfInstance(scene, id - 1 - shape_count_);
  }
  if (id >= file_count_ + 2) return scene.objects[id - file_count_ - 2].name;
  return id <= 2 ? kMainAsset : scene.files[id - 2];
}

void SceneIds::NameAll(const SceneDescription& scene, FilmTile* tile) const {
  for (size_t i = 0; i < kIdKindCount; ++i) {
    const auto kind = static_cast<IdKind>(i);
    IdSums& ids = tile->ids(kind);
    for (const IdList& list : ids.pixels) {
      for (const IdWeight& entry : list) {
        if (entry.id == kNoId || ids.names.contains(entry.id)) continue;
        ids.names[entry.id] = NameOf(kind, entry.id, scene);
      }
    }
  }
}

}  // namespace sheaf::render
