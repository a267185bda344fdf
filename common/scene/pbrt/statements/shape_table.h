// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ShapeTable: reads Shape directives, keeps the meshes of a scene (one per file, shared by all its
// uses), and counts the memory they take.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "common/scene/formats/ply_reader.h"
#include "common/scene/pbrt/statements/mesh_parameters.h"
#include "common/scene/pbrt/statements/scene_files.h"
#include "common/scene/pbrt/statements/texture_table.h"
#include "common/scene/pbrt/syntax/parameter_list.h"
#include "common/scene/scene_description.h"
#include "common/scene/scene_reader_limits.h"

namespace sheaf {

class ShapeTable {
 public:
  // Requires: all pointers outlive this.
  ShapeTable(SceneDescription* scene, TextureTable* textures, SceneFiles* files,
             Diagnostics* diagnostics, const SceneReaderLimits& limits)
      : scene_(scene),
        textures_(textures),
        files_(files),
        diagnostics_(diagnostics),
        limits_(limits) {}

  // Factor on the edge lengths of displaced meshes. Requires: scale > 0.
  void set_displacement_edge_scale(float scale) { displacement_edge_scale_ = scale; }

  // Fills in shape->shape from the parameters, and reports unused ones. False (reported) if there
  // is no shape to add.
  bool SetShape(const std::string& type, ParameterList& parameters, ShapeDescription* shape);

  // If `shape` consists of curves and differs from one of the latest of `earlier` (indices of the
  // scene's shapes) in nothing else, adds the curves to that shape and returns true: `shape` is
  // then not needed. Files list curves one by one, in hundreds of thousands.
  bool JoinCurves(const std::vector<int32_t>& earlier, const ShapeDescription& shape);

  // Notes what the files of meshes have that has no effect, once for all files. Call once, after
  // the last shape.
  void ReportSkipped();

  // Counts memory of the description. False (reported once) beyond memory_bytes_max.
  bool ChargeMemory(uint64_t size_bytes, SourceLocation location);

 private:
  bool SetTriangleMesh(ParameterList& parameters, ShapeDescription* shape);
  bool SetPlyMesh(ParameterList& parameters, ShapeDescription* shape);
  bool SetLoopSubdivision(ParameterList& parameters, ShapeDescription* shape);
  bool SetBilinearMesh(ParameterList& parameters, ShapeDescription* shape);
  bool SetSphere(ParameterList& parameters, ShapeDescription* shape);
  bool SetDisk(ParameterList& parameters, ShapeDescription* shape);
  bool SetCylinder(ParameterList& parameters, ShapeDescription* shape);
  bool SetCurve(ParameterList& parameters, ShapeDescription* shape);
  // The mesh of one file, or of several, one for each step over the shutter. Empty (reported) if
  // one cannot be read or does not fit the first.
  std::optional<TriangleMesh> ReadPlyFiles(const std::vector<std::string>& names, PlyColors colors,
                                           ParameterList& parameters, MeshOrigin* at);
  bool SetLevelSet(ParameterList& parameters, ShapeDescription* shape);
  void AddSkipped(const std::string& file, SourceLocation location, const PlySkipped& skipped);
  bool AddMesh(TriangleMesh mesh, ParameterList& parameters, int32_t* index);
  // Reads the shape's parameters that apply to its mesh. False (reported) if they are inconsistent.
  bool FinishMesh(ParameterList& parameters, ShapeDescription* shape, MeshShape mesh);
  // False (reported) if there is not enough memory to refine this many triangles.
  bool HasRoomToRefine(uint64_t triangle_count, int32_t levels, ParameterList& parameters);
  // False (reported) beyond triangles_max; a patch counts as two triangles.
  bool ChargeTriangles(uint64_t count, ParameterList& parameters);

  SceneDescription* scene_;
  TextureTable* textures_;
  SceneFiles* files_;
  Diagnostics* diagnostics_;
  SceneReaderLimits limits_;
  float displacement_edge_scale_ = 1;
  struct FileMesh {
    int32_t mesh = kNone;  // kNone if the files cannot be read.
    MeshOrigin at;
  };
  // Keyed by the names of a mesh's files, whether its origin may move, and whether it has colors.
  std::map<std::tuple<std::vector<std::string>, bool, bool>, FileMesh> mesh_of_files_;
  struct SkippedInFiles {
    std::string file;  // The first.
    SourceLocation location;
    PlySkipped first;  // With the count of all.
    uint64_t file_count = 0;
  };
  std::map<std::pair<std::string, std::string>, SkippedInFiles> skipped_;  // By its text.
  uint64_t memory_bytes_ = 0;
  uint64_t triangle_count_ = 0;
};

}  // namespace sheaf
