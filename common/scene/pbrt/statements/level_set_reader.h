// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Reads the shape "levelset", an extension of Sheaf: the surface of a grid in a .vdb file.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "common/scene/pbrt/statements/mesh_parameters.h"
#include "common/scene/pbrt/statements/scene_files.h"
#include "common/scene/pbrt/syntax/parameter_list.h"
#include "common/scene/scene_description.h"
#include "common/scene/scene_reader_limits.h"

namespace sheaf {

struct LevelSetParameters {
  std::string file;  // Canonical name.
  std::string grid;  // Empty: the only one of the file.
  float isovalue = 0;

  // Equal for equal meshes, and unlike the names of a plymesh's files.
  std::vector<std::string> Key() const;
};
// Empty (reported) if there is no file.
std::optional<LevelSetParameters> ReadLevelSetParameters(ParameterList& parameters);

// The surface as a mesh; warned about if it is empty. Empty (reported) if it cannot be read.
std::optional<TriangleMesh> ReadLevelSet(const LevelSetParameters& wanted,
                                         const SceneReaderLimits& limits, ParameterList& parameters,
                                         SceneFiles& files, Diagnostics* diagnostics,
                                         MeshOrigin* at);

}  // namespace sheaf
