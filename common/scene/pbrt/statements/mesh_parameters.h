// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The vertices and faces of meshes as parameters give them, checked. Every problem is reported, and
// a mesh counts only without one.
#pragma once

#include "common/scene/pbrt/syntax/parameter_list.h"
#include "common/scene/scene_description.h"

namespace sheaf {

// A mesh may have so many sets of vertices after the first: more than Embree's boxes need.
inline constexpr int kVertexStepsMax = 16;

// P, N, uv and indices; faceIndices is noted.
bool ReadTriangles(ParameterList& parameters, TriangleMesh* mesh);
bool ReadPatches(ParameterList& parameters, BilinearMesh* mesh);
// "P1", "N1" and so on, Sheaf's own: the vertices later in the shutter.
bool ReadVertexSteps(ParameterList& parameters, TriangleMesh* mesh);
// Only the indices, of a mesh whose positions are known.
bool ReadTriangleIndices(ParameterList& parameters, TriangleMesh* mesh);

// Whether the mesh deforms; steps that say the same as the first go.
bool Deforms(const TriangleMesh& mesh);
void DropEqualSteps(TriangleMesh* mesh);

// Memory of the description.
uint64_t MeshBytes(const TriangleMesh& mesh);
uint64_t MeshBytes(const BilinearMesh& mesh);

}  // namespace sheaf
