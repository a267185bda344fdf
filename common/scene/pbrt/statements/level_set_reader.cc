// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/pbrt/statements/level_set_reader.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/scene/vertex_rounding.h"
#include "common/volume/volume_surface.h"

namespace sheaf {
namespace {

// A grid is compressed, and a process of its own reads it: one reading costs as much as that of
// this many bytes of text.
constexpr uint64_t kReadingBytes = uint64_t{4} << 20;

}  // namespace

std::vector<std::string> LevelSetParameters::Key() const {
  return {file, "", grid, absl::StrCat(isovalue)};
}

std::optional<LevelSetParameters> ReadLevelSetParameters(ParameterList& parameters) {
  LevelSetParameters wanted;
  const std::string filename = parameters.GetString("filename", "");
  wanted.grid = parameters.GetString("gridname", "");
  wanted.isovalue = parameters.GetFloat("isovalue", 0);
  if (filename.empty()) {
    parameters.Error(absl::StrCat(parameters.owner(), " needs \"string filename\", a .vdb file"));
    return std::nullopt;
  }
  wanted.file = CanonicalFileName(filename);
  return wanted;
}

std::optional<TriangleMesh> ReadLevelSet(const LevelSetParameters& wanted,
                                         const SceneReaderLimits& limits, ParameterList& parameters,
                                         SceneFiles& files, Diagnostics* diagnostics,
                                         MeshOrigin* at) {
  VolumeLimits volume_limits;
  volume_limits.grid_bytes_max = std::min(volume_limits.grid_bytes_max, limits.memory_bytes_max);
  const absl::StatusOr<std::string> path = files.PathToRead(wanted.file, kReadingBytes);
  absl::StatusOr<VolumeSurface> surface =
      path.ok() ? ReadVolumeSurface(wanted.file, *path, wanted.grid, wanted.isovalue, volume_limits)
                : absl::StatusOr<VolumeSurface>(path.status());
  if (!surface.ok()) {
    const std::string text(surface.status().message());
    if (absl::IsResourceExhausted(surface.status())) {
      diagnostics->MemoryError(parameters.location(), absl::StrCat(parameters.owner(), ": ", text));
    } else {
      parameters.ErrorAt(*parameters.Find("filename"), absl::StrCat("cannot be read: ", text));
    }
    return std::nullopt;
  }
  if (surface->triangles.empty()) {
    diagnostics->Warning(parameters.location(),
                         absl::StrCat(parameters.owner(), ": ", wanted.file, " has no surface at ",
                                      "isovalue ", wanted.isovalue, ": nothing is shown"));
  }
  TriangleMesh mesh;
  VertexRounding rounding;
  rounding.Reserve(surface->positions.size());
  for (const Vec3d& p : surface->positions) rounding.Add(p);
  mesh.positions = at->may_move ? rounding.Take(&at->origin) : rounding.TakeAbout(at->origin);
  mesh.normals = std::move(surface->normals);
  mesh.indices = std::move(surface->triangles);
  mesh.file = wanted.file;
  return mesh;
}

}  // namespace sheaf
