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

// Reads P, N, uv and indices; notes faceIndices.
bool ReadTriangles(ParameterList& parameters, TriangleMesh* mesh);
bool ReadPatches(ParameterList& parameters, BilinearMesh* mesh);
// Reads "P1", "N1" and so on, an extension of Sheaf: the vertices at later times of the shutter.
bool ReadVertexSteps(ParameterList& parameters, TriangleMesh* mesh);
// Reads only the indices of a mesh whose positions are known.
bool ReadTriangleIndices(ParameterList& parameters, TriangleMesh* mesh);

// Whether the mesh deforms. Steps equal to the first are removed.
bool Deforms(const TriangleMesh& mesh);
void DropEqualSteps(TriangleMesh* mesh);

// Memory of the description, in bytes.
uint64_t MeshBytes(const TriangleMesh& mesh);
uint64_t MeshBytes(const BilinearMesh& mesh);

}  // namespace sheaf
