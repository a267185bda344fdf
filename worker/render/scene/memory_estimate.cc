// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/scene/memory_estimate.h"

#include <filesystem>
#include <system_error>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/memory_room.h"
#include "common/volume/page_maker.h"
#include "common/volume/volume_pages.h"

namespace sheaf::render {
namespace {

// Estimates, not measured: baked vertices, Embree's trees, and their build-time memory.
constexpr uint64_t kTriangleBytes = 170;
constexpr uint64_t kCurveBytes = 260;
constexpr uint64_t kInstanceBytes = 600;
// Sparse voxels are compressed in a file but not in memory, which also holds cell bounds.
constexpr uint64_t kVolumeFileFactor = 2;
// An index is in memory twice while it is verified.
constexpr uint64_t kPageIndexFactor = 2;

uint64_t VolumeBytes(const MediumDescription& medium, FileSource& files) {
  if (const auto* grid = std::get_if<UniformGridMedium>(&medium.kind)) {
    return (grid->density.size() + grid->temperature_k.size() + grid->radiance_scale.size()) *
               sizeof(float) +
           grid->velocity.size() * sizeof(Vec3f);
  }
  if (const auto* grid = std::get_if<RgbGridMedium>(&medium.kind)) {
    return (grid->sigma_a.size() + grid->sigma_s.size() + grid->radiance.size()) * sizeof(Rgb);
  }
  const auto* volume = std::get_if<VolumeFileMedium>(&medium.kind);
  if (volume == nullptr) return 0;
  const absl::StatusOr<std::string> path = files.LocalPath(volume->file);
  // A page file's index alone is always in memory.
  if (const auto index = path.ok() ? PageIndexBytes(*path) : std::nullopt) {
    return *index * kPageIndexFactor;
  }
  std::error_code error;
  const uint64_t size = path.ok() ? std::filesystem::file_size(*path, error) : 0;
  return error ? 0 : size * kVolumeFileFactor;
}

// Whether no file of the medium can be made a page file: it is one, or the grids are in the scene.
bool IsPaged(const MediumDescription& medium, FileSource& files) {
  const auto* volume = std::get_if<VolumeFileMedium>(&medium.kind);
  if (volume == nullptr) return true;
  const absl::StatusOr<std::string> path = files.LocalPath(volume->file);
  return path.ok() && PageIndexBytes(*path).has_value();
}

// Each shape that moves within an object is placed on its own by each of the object's instances.
uint64_t PlacementsOf(const SceneDescription& scene) {
  std::vector<uint64_t> placements;
  for (const ObjectDefinition& object : scene.objects) {
    placements.push_back(1);
    for (const int32_t shape : object.shapes) {
      if (scene.shapes[shape].world_from_object.IsAnimated()) ++placements.back();
    }
  }
  uint64_t sum = 0;
  for (const ObjectInstance& instance : scene.instances) {
    sum += placements[static_cast<size_t>(instance.object)];
  }
  return sum;
}

}  // namespace

MemoryEstimate EstimateMemory(const SceneDescription& scene, FileSource& files) {
  MemoryEstimate estimate;
  for (const ShapeDescription& shape : scene.shapes) {
    uint64_t triangles = 0, curves = 0;
    if (const auto* mesh = std::get_if<MeshShape>(&shape.shape)) {
      triangles = scene.meshes[static_cast<size_t>(mesh->mesh)].indices.size() / 3;
    } else if (const auto* patches = std::get_if<BilinearMeshShape>(&shape.shape)) {
      triangles = scene.bilinear_meshes[static_cast<size_t>(patches->mesh)].indices.size() / 2;
    } else if (const auto* hair = std::get_if<CurveShape>(&shape.shape)) {
      curves = scene.curve_sets[static_cast<size_t>(hair->curves)].size();
    }
    const uint64_t bytes = triangles * kTriangleBytes + curves * kCurveBytes;
    estimate.triangle_count += triangles;
    estimate.curve_count += curves;
    estimate.surface_bytes += bytes;
    if (bytes <= estimate.largest_bytes) continue;
    estimate.largest = shape.location;
    estimate.largest_bytes = bytes;
  }
  estimate.instance_count = scene.instances.size();
  estimate.surface_bytes += PlacementsOf(scene) * kInstanceBytes;
  for (const MediumDescription& medium : scene.media) {
    const uint64_t bytes = VolumeBytes(medium, files);
    estimate.volume_bytes += bytes;
    if (!IsPaged(medium, files)) {
      estimate.unpaged_bytes += bytes;
    } else if (std::holds_alternative<VolumeFileMedium>(medium.kind)) {
      estimate.has_pages = true;
    }
  }
  return estimate;
}

std::string FormatMemoryEstimate(const MemoryEstimate& estimate) {
  std::string text = absl::StrCat(FormatMemory(estimate.TotalBytes()),
                                  " while it is loaded: ", estimate.triangle_count, " triangles");
  if (estimate.curve_count > 0) absl::StrAppend(&text, ", ", estimate.curve_count, " curves");
  if (estimate.instance_count > 0) {
    absl::StrAppend(&text, ", ", estimate.instance_count, " instances");
  }
  absl::StrAppend(&text, " ", FormatMemory(estimate.surface_bytes));
  if (estimate.volume_bytes > 0) {
    absl::StrAppend(&text, ", volumes ", FormatMemory(estimate.volume_bytes));
  }
  if (estimate.has_pages) {
    absl::StrAppend(&text, "; and pages of volumes, up to ",
                    FormatMemory(volume::VolumePages::kBytesMaxDefault), " (--volume-memory-max)");
  }
  return text;
}

std::string PageFileNote(const MemoryEstimate& estimate) {
  if (estimate.unpaged_bytes <= volume::VolumePages::kBytesMaxDefault) return "";
  return absl::StrCat("files of volumes take ", FormatMemory(estimate.unpaged_bytes),
                      " of these: submit and render make page files of large ones, which take ",
                      FormatMemory(volume::VolumePages::kBytesMaxDefault),
                      " (--volume-memory-max)");
}

}  // namespace sheaf::render
