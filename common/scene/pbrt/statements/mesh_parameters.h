// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Reads and checks the vertices and faces of meshes given as parameters. Every problem is reported,
// and a mesh is accepted only without problems.
#pragma once

#include "common/scene/pbrt/syntax/parameter_list.h"
#include "common/scene/scene_description.h"

namespace sheaf {

// Maximum number of vertex sets after the first: more than Embree's boxes need.
inline constexpr int kVertexStepsMax = 16;

// Where the vertices of a mesh are rounded to float: as VertexRounding.
struct MeshOrigin {
  bool may_move = true;
  Vec3d origin{};  // 0 if it may not.
};

// Reads P, N, uv and indices; notes faceIndices. Vertices are relative to at->origin, which is set.
bool ReadTriangles(ParameterList& parameters, TriangleMesh* mesh, MeshOrigin* at);
bool ReadPatches(ParameterList& parameters, BilinearMesh* mesh, MeshOrigin* at);
// Reads "P1", "N1" and so on, an extension of Sheaf: the vertices at later times of the shutter.
bool ReadVertexSteps(ParameterList& parameters, const MeshOrigin& at, TriangleMesh* mesh);
// Reads P alone.
std::vector<Vec3f> ReadPositions(ParameterList& parameters, MeshOrigin* at);
// Reads only the indices of a mesh whose positions are known.
bool ReadTriangleIndices(ParameterList& parameters, TriangleMesh* mesh);

// Whether the mesh deforms. Steps equal to the first are removed.
bool Deforms(const TriangleMesh& mesh);
void DropEqualSteps(TriangleMesh* mesh);

// Memory of the description, in bytes.
uint64_t MeshBytes(const TriangleMesh& mesh);
uint64_t MeshBytes(const BilinearMesh& mesh);

}  // namespace sheaf
