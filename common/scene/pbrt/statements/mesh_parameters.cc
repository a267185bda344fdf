// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/pbrt/statements/mesh_parameters.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

namespace sheaf {
namespace {

// The kinds of faces.
struct FaceKind {
  const char* name;         // "triangle"
  const char* corner_text;  // "three"
  size_t corner_count;
};
constexpr FaceKind kTriangle{"triangle", "three", 3};
constexpr FaceKind kPatch{"patch", "four", 4};

template <typename Mesh>
bool SetIndices(ParameterList& parameters, const FaceKind& face, Mesh* mesh) {
  const Parameter* parameter = parameters.FindTyped("indices", ParameterType::kInteger);
  const size_t vertex_count = mesh->positions.size();
  if (parameter == nullptr) {
    if (parameters.Has("indices")) return false;
    if (vertex_count == face.corner_count) {
      for (uint32_t i = 0; i < face.corner_count; ++i) mesh->indices.push_back(i);
      return true;
    }
    parameters.Error(absl::StrCat(
        parameters.owner(), " needs \"integer indices\" where it has more than one ", face.name));
    return false;
  }
  const std::vector<int32_t>& indices = parameter->integers;
  if (indices.size() % face.corner_count != 0) {
    parameters.ErrorAt(*parameter, absl::StrCat("needs ", face.corner_text, " indices a ",
                                                face.name, ", but has ", indices.size()));
    return false;
  }
  for (size_t i = 0; i < indices.size(); ++i) {
    if (indices[i] >= 0 && static_cast<size_t>(indices[i]) < vertex_count) continue;
    parameters.ErrorAt(*parameter, absl::StrCat("holds ", indices[i], " in ", face.name, " ",
                                                i / face.corner_count, ", outside [0, ",
                                                vertex_count, "), the range of P's vertices"));
    return false;
  }
  mesh->indices.assign(indices.begin(), indices.end());
  return true;
}

template <typename T>
bool CheckCountOf(ParameterList& parameters, const std::string& name, const std::vector<T>& values,
                  size_t vertex_count) {
  if (values.empty() || values.size() == vertex_count) return true;
  parameters.ErrorAt(
      *parameters.Find(name),
      absl::StrCat("has ", values.size(), " entries, but P has ", vertex_count, " vertices"));
  return false;
}

template <typename Mesh>
bool ReadFaces(ParameterList& parameters, const FaceKind& face, Mesh* mesh, MeshOrigin* at) {
  mesh->positions = ReadPositions(parameters, at);
  mesh->normals = parameters.GetTriples("N", ParameterType::kNormal);
  mesh->uvs = parameters.GetPoints2("uv");
  parameters.NoteWithoutEffect("faceIndices", "Sheaf has no ptex textures");
  if (mesh->positions.empty()) {
    parameters.Error(absl::StrCat(parameters.owner(), " needs \"point3 P\", its vertices"));
    parameters.Find("indices");
    return false;
  }
  const size_t vertex_count = mesh->positions.size();
  bool is_good = SetIndices(parameters, face, mesh);
  is_good = CheckCountOf(parameters, "N", mesh->normals, vertex_count) && is_good;
  return CheckCountOf(parameters, "uv", mesh->uvs, vertex_count) && is_good;
}

// Mesh: of triangles or of patches.
template <typename Mesh>
uint64_t BytesOf(const Mesh& mesh) {
  return (mesh.positions.size() + mesh.normals.size()) * sizeof(Vec3f) +
         mesh.uvs.size() * sizeof(Vec2f) + mesh.indices.size() * sizeof(uint32_t) + sizeof(Mesh);
}

}  // namespace

std::vector<Vec3f> ReadPositions(ParameterList& parameters, MeshOrigin* at) {
  VertexRounding vertices = parameters.GetVertices("P");
  return at->may_move ? vertices.Take(&at->origin) : vertices.TakeAbout(at->origin);
}

bool ReadTriangles(ParameterList& parameters, TriangleMesh* mesh, MeshOrigin* at) {
  const bool is_good = ReadFaces(parameters, kTriangle, mesh, at);
  mesh->tangents = parameters.GetTriples("S", ParameterType::kVector3);
  return is_good && CheckCountOf(parameters, "S", mesh->tangents, mesh->positions.size());
}

bool ReadPatches(ParameterList& parameters, BilinearMesh* mesh, MeshOrigin* at) {
  return ReadFaces(parameters, kPatch, mesh, at);
}

bool ReadTriangleIndices(ParameterList& parameters, TriangleMesh* mesh) {
  return SetIndices(parameters, kTriangle, mesh);
}

bool ReadVertexSteps(ParameterList& parameters, const MeshOrigin& at, TriangleMesh* mesh) {
  bool is_good = true;
  for (int i = 1; i <= kVertexStepsMax; ++i) {
    const std::string p = absl::StrCat("P", i), n = absl::StrCat("N", i);
    if (!parameters.Has(p)) break;
    VertexStep step;
    step.positions = parameters.GetVertices(p).TakeAbout(at.origin);
    step.normals = parameters.GetTriples(n, ParameterType::kNormal);
    if (step.positions.empty()) return false;  // Reported.
    is_good = CheckCountOf(parameters, p, step.positions, mesh->positions.size()) && is_good;
    is_good = CheckCountOf(parameters, n, step.normals, mesh->positions.size()) && is_good;
    if (step.normals.empty() != mesh->normals.empty()) {
      parameters.ErrorAt(*parameters.Find(p), absl::StrCat("needs \"normal ", n,
                                                           "\" where there is \"normal N\", and "
                                                           "none where there is not"));
      is_good = false;
    }
    mesh->steps.push_back(std::move(step));
  }
  if (is_good) DropEqualSteps(mesh);
  return is_good;
}

bool Deforms(const TriangleMesh& mesh) { return !mesh.steps.empty(); }

void DropEqualSteps(TriangleMesh* mesh) {
  const bool is_still =
      std::all_of(mesh->steps.begin(), mesh->steps.end(), [mesh](const VertexStep& step) {
        return step.positions == mesh->positions && step.normals == mesh->normals;
      });
  if (is_still) mesh->steps.clear();
}

uint64_t MeshBytes(const TriangleMesh& mesh) {
  uint64_t bytes = BytesOf(mesh) + mesh.tangents.size() * sizeof(Vec3f);
  for (const VertexStep& step : mesh.steps) {
    bytes += (step.positions.size() + step.normals.size()) * sizeof(Vec3f) + sizeof(VertexStep);
  }
  return bytes;
}

uint64_t MeshBytes(const BilinearMesh& mesh) { return BytesOf(mesh); }

}  // namespace sheaf
