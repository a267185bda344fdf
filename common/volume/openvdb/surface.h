// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SurfaceOf: the surface on which a grid has a value, by OpenVDB's mesher.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "common/volume/openvdb/archive.h"
#include "common/volume/openvdb/headers.h"
#include "common/volume/volume_surface.h"

namespace sheaf::volume {

inline Vec3d Of(const vdb::Vec3d& v) { return {v.x(), v.y(), v.z()}; }

// The direction in which the values increase, in world space; 0 if they do not.
template <typename SamplerT>
vdb::Vec3d Gradient(const SamplerT& sampler, const vdb::Vec3d& at, const vdb::Vec3d& voxel) {
  vdb::Vec3d gradient;
  for (int axis = 0; axis < 3; ++axis) {
    vdb::Vec3d step(0);
    step[axis] = voxel[axis] / 2;
    gradient[axis] = (sampler.wsSample(at + step) - sampler.wsSample(at - step)) / voxel[axis];
  }
  const double length = gradient.length();
  return length > 0 && std::isfinite(length) ? gradient / length : vdb::Vec3d(0);
}

// points: in index space. sign: 1 if values increase out of the body, -1 if they decrease.
inline void AddPoints(const vdb::FloatGrid& grid, const std::vector<vdb::Vec3s>& points,
                      double sign, VolumeSurface* surface) {
  const vdb::tools::GridSampler<vdb::FloatGrid, vdb::tools::BoxSampler> sampler(grid);
  surface->positions.reserve(points.size());
  surface->normals.reserve(points.size());
  for (const vdb::Vec3s& point : points) {
    const vdb::Vec3d at = grid.transform().indexToWorld(vdb::Vec3d(point));
    const vdb::Vec3d voxel = grid.transform().voxelSize(vdb::Vec3d(point));
    surface->positions.push_back(Of(at));
    surface->normals.push_back(ToFloat(Of(sign * Gradient(sampler, at, voxel))));
  }
}

// Turns the triangle the way that the normals of its corners say.
inline void AddTriangle(std::array<uint32_t, 3> corners, VolumeSurface* surface) {
  const auto at = [&](size_t i) { return surface->positions[corners[i]]; };
  const auto normal = [&](size_t i) { return ToDouble(surface->normals[corners[i]]); };
  const Vec3d face = Cross(at(1) - at(0), at(2) - at(0));
  if (Dot(face, normal(0) + normal(1) + normal(2)) < 0) std::swap(corners[1], corners[2]);
  surface->triangles.insert(surface->triangles.end(), corners.begin(), corners.end());
}

inline absl::StatusOr<VolumeSurface> SurfaceOf(const std::string& where, int file, size_t index,
                                               float isovalue, const VolumeLimits& limits) {
  Archive archive(file);
  if (absl::Status status = archive.Open(where, limits); !status.ok()) return status;
  if (index >= archive.size()) return CutShort(where);
  const vdb::io::GridDescriptor& descriptor = archive.Descriptor(index);
  if (IsVector(descriptor.gridType())) {
    return absl::InvalidArgumentError(
        absl::StrCat(where, ": grid \"", descriptor.gridName(), "\" is a ", TypeName(descriptor),
                     ", which has no surface; name a grid of numbers, such as a level set"));
  }
  if (!IsScalar(descriptor.gridType())) return NotReadable(where, descriptor);
  auto stored = archive.Read(where, index);
  if (!stored.ok()) return stored.status();
  const vdb::FloatGrid::Ptr grid = Scalars(*std::move(stored));
  // In index space, because points are floats: a grid far from its origin would lose their places.
  const auto unplaced = vdb::FloatGrid::create(grid->treePtr());
  unplaced->setGridClass(grid->getGridClass());
  std::vector<vdb::Vec3s> points;
  std::vector<vdb::Vec3I> triangles;
  std::vector<vdb::Vec4I> quads;
  vdb::tools::volumeToMesh(*unplaced, points, triangles, quads, isovalue, /*adaptivity=*/0);
  const uint64_t bytes = points.size() * (sizeof(Vec3d) + sizeof(Vec3f)) +
                         3 * sizeof(uint32_t) * (triangles.size() + 2 * quads.size());
  if (bytes > limits.grid_bytes_max) {
    return absl::ResourceExhaustedError(
        absl::StrCat(where, ": the surface of grid \"", descriptor.gridName(), "\" takes ", bytes,
                     " bytes, more than ", limits.grid_bytes_max, " (grid_bytes_max)"));
  }
  VolumeSurface surface;
  AddPoints(*grid, points, grid->getGridClass() == vdb::GRID_LEVEL_SET ? 1 : -1, &surface);
  surface.triangles.reserve(3 * (triangles.size() + 2 * quads.size()));
  for (const vdb::Vec3I& t : triangles) AddTriangle({t[0], t[1], t[2]}, &surface);
  for (const vdb::Vec4I& q : quads) {
    AddTriangle({q[0], q[1], q[2]}, &surface);
    AddTriangle({q[0], q[2], q[3]}, &surface);
  }
  return surface;
}

}  // namespace sheaf::volume
