// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ShapeTable: what Shape says, the meshes of a scene (one for each file, however often it is used),
// and how much memory they take.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "common/scene/file_source.h"
#include "common/scene/parameter_list.h"
#include "common/scene/scene_description.h"
#include "common/scene/scene_reader.h"

namespace sheaf {

class ShapeTable {
 public:
  // Requires: all outlive this.
  ShapeTable(SceneDescription* scene, FileSource* files, Diagnostics* diagnostics,
             const SceneReaderLimits& limits)
      : scene_(scene), files_(files), diagnostics_(diagnostics), limits_(limits) {}

  // Fills in shape->shape from the parameters, and reports those nobody asked for. False (reported)
  // where there is no shape to add.
  bool SetShape(const std::string& type, ParameterList& parameters, ShapeDescription* shape);

  // Where `shape` is of curves and one of the latest of `earlier` (indices of the scene's shapes)
  // differs from it by nothing else, adds the curves to that one and says true: `shape` is not
  // needed. Files write curves one by one, in hundreds of thousands.
  bool JoinCurves(const std::vector<int32_t>& earlier, const ShapeDescription& shape);

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
  bool AddMesh(TriangleMesh mesh, ParameterList& parameters, int32_t* index);
  // False (reported) beyond triangles_max; a patch counts as two triangles.
  bool ChargeTriangles(uint64_t count, ParameterList& parameters);

  SceneDescription* scene_;
  FileSource* files_;
  Diagnostics* diagnostics_;
  SceneReaderLimits limits_;
  std::map<std::string, int32_t> mesh_of_file_;  // kNone for files that cannot be read.
  uint64_t memory_bytes_ = 0;
  uint64_t triangle_count_ = 0;
};

}  // namespace sheaf
