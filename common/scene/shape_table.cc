// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/shape_table.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/scene/curve_reader.h"
#include "common/scene/loop_subdivision.h"
#include "common/scene/ply_reader.h"

namespace sheaf {
namespace {

// What a triangle takes while a surface is refined: both levels' faces, edges and vertices.
constexpr uint64_t kRefinedTriangleBytes = 160;
// How many shapes back curves look for others like them: curves of a few materials may take turns.
constexpr size_t kJoinReachMax = 8;

bool IsSamePlace(const TransformOverTime& a, const TransformOverTime& b) {
  return a.start == b.start && a.end == b.end && a.start_time == b.start_time &&
         a.end_time == b.end_time;
}
template <typename T>
void Append(const std::vector<T>& from, std::vector<T>* to) {
  to->insert(to->end(), from.begin(), from.end());
}
uint64_t CurveBytes(const CurveSet& curves) {
  return (curves.points.size() + curves.normals.size()) * sizeof(Vec3f) +
         curves.widths.size() * sizeof(float);
}

// Of triangles or patches.
template <typename Mesh>
uint64_t MeshBytes(const Mesh& mesh) {
  return mesh.positions.size() * sizeof(Vec3f) + mesh.normals.size() * sizeof(Vec3f) +
         mesh.uvs.size() * sizeof(Vec2f) + mesh.indices.size() * sizeof(uint32_t) + sizeof(Mesh);
}

// What a mesh is made of.
struct FaceKind {
  const char* name;         // "triangle"
  const char* corner_text;  // "three"
  size_t corner_count;
};
constexpr FaceKind kTriangle{"triangle", "three", 3};
constexpr FaceKind kPatch{"patch", "four", 4};

// Every problem is reported; the mesh counts only without one.
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
bool CheckCountOf(ParameterList& parameters, const char* name, const std::vector<T>& values,
                  size_t vertex_count) {
  if (values.empty() || values.size() == vertex_count) return true;
  parameters.ErrorAt(
      *parameters.Find(name),
      absl::StrCat("has ", values.size(), " entries, but P has ", vertex_count, " vertices"));
  return false;
}

}  // namespace

bool ShapeTable::ChargeMemory(uint64_t size_bytes, SourceLocation location) {
  const bool was_within = memory_bytes_ <= limits_.memory_bytes_max;
  memory_bytes_ += size_bytes;
  if (memory_bytes_ <= limits_.memory_bytes_max) return true;
  if (was_within) {
    diagnostics_->Error(location,
                        absl::StrCat("the scene exceeds the limit of ", limits_.memory_bytes_max,
                                     " bytes (memory_bytes_max)"));
  }
  return false;
}

bool ShapeTable::SetShape(const std::string& type, ParameterList& parameters,
                          ShapeDescription* shape) {
  bool is_good = false;
  if (type == "trianglemesh") {
    is_good = SetTriangleMesh(parameters, shape);
  } else if (type == "plymesh") {
    is_good = SetPlyMesh(parameters, shape);
  } else if (type == "loopsubdiv") {
    is_good = SetLoopSubdivision(parameters, shape);
  } else if (type == "sphere") {
    is_good = SetSphere(parameters, shape);
  } else if (type == "disk") {
    is_good = SetDisk(parameters, shape);
  } else if (type == "cylinder") {
    is_good = SetCylinder(parameters, shape);
  } else if (type == "bilinearmesh") {
    is_good = SetBilinearMesh(parameters, shape);
  } else if (type == "curve") {
    is_good = SetCurve(parameters, shape);
  } else {
    parameters.Error(absl::StrCat(parameters.owner(),
                                  " is not supported; Sheaf does trianglemesh, plymesh, "
                                  "loopsubdiv, bilinearmesh, sphere, disk, cylinder and curve"));
    return false;
  }
  parameters.ReportUnused();
  return is_good && ChargeMemory(sizeof(ShapeDescription), parameters.location());
}

bool ShapeTable::SetTriangleMesh(ParameterList& parameters, ShapeDescription* shape) {
  TriangleMesh mesh;
  mesh.positions = parameters.GetTriples("P", ParameterType::kPoint3);
  mesh.normals = parameters.GetTriples("N", ParameterType::kNormal);
  mesh.uvs = parameters.GetPoints2("uv");
  parameters.NoteWithoutEffect("S", "no material of Sheaf depends on tangents");
  parameters.NoteWithoutEffect("faceIndices", "Sheaf has no ptex textures");
  if (mesh.positions.empty()) {
    parameters.Error(absl::StrCat(parameters.owner(), " needs \"point3 P\", its vertices"));
    parameters.Find("indices");
    return false;
  }
  const size_t vertex_count = mesh.positions.size();
  bool is_good = SetIndices(parameters, kTriangle, &mesh);
  is_good = CheckCountOf(parameters, "N", mesh.normals, vertex_count) && is_good;
  is_good = CheckCountOf(parameters, "uv", mesh.uvs, vertex_count) && is_good;
  if (!is_good) return false;
  MeshShape mesh_shape;
  if (!AddMesh(std::move(mesh), parameters, &mesh_shape.mesh)) return false;
  shape->shape = mesh_shape;
  return true;
}

bool ShapeTable::SetPlyMesh(ParameterList& parameters, ShapeDescription* shape) {
  parameters.RejectUnsupported("displacement", "Sheaf does not displace meshes; remove it");
  parameters.NoteWithoutEffect("edgelength", "it is for displacement");
  const std::string filename = parameters.GetString("filename", "");
  if (filename.empty()) {
    parameters.Error(absl::StrCat(parameters.owner(), " needs \"string filename\""));
    return false;
  }
  const std::string name = CanonicalFileName(filename);
  const auto [entry, is_new] = mesh_of_file_.emplace(name, kNone);
  if (is_new) {
    const Parameter& parameter = *parameters.Find("filename");
    const absl::StatusOr<std::string> path = files_->LocalPath(name);
    absl::StatusOr<TriangleMesh> mesh = absl::UnknownError("");
    if (path.ok()) mesh = ReadPly(*path, limits_);
    const absl::Status status = path.ok() ? mesh.status() : path.status();
    if (!status.ok()) {
      parameters.ErrorAt(parameter, absl::StrCat("cannot be read: ", name, ": ", status.message()));
      return false;
    }
    mesh->file = name;
    if (!AddMesh(std::move(*mesh), parameters, &entry->second)) return false;
  }
  if (entry->second == kNone) return false;  // Reported at its first use.
  shape->shape = MeshShape{entry->second};
  return true;
}

bool ShapeTable::SetLoopSubdivision(ParameterList& parameters, ShapeDescription* shape) {
  TriangleMesh control;
  control.positions = parameters.GetTriples("P", ParameterType::kPoint3);
  const int32_t levels = parameters.GetInteger("levels", 3);
  parameters.NoteWithoutEffect("scheme", "loop is the only scheme");
  if (control.positions.empty() || levels < 0) {
    parameters.Error(absl::StrCat(parameters.owner(),
                                  " needs \"point3 P\", its vertices, and levels "
                                  "of 0 or more"));
    parameters.Find("indices");
    return false;
  }
  if (!SetIndices(parameters, kTriangle, &control)) return false;
  const uint64_t triangles_max =
      std::min(limits_.triangles_max, limits_.memory_bytes_max / kRefinedTriangleBytes);
  absl::StatusOr<TriangleMesh> mesh =
      SubdivideLoop(control.positions, control.indices, levels, triangles_max);
  if (!mesh.ok()) {
    parameters.Error(absl::StrCat(parameters.owner(), ": ", mesh.status().message()));
    return false;
  }
  MeshShape mesh_shape;
  if (!AddMesh(std::move(*mesh), parameters, &mesh_shape.mesh)) return false;
  shape->shape = mesh_shape;
  return true;
}

bool ShapeTable::ChargeTriangles(uint64_t count, ParameterList& parameters) {
  triangle_count_ += count;
  if (triangle_count_ <= limits_.triangles_max) return true;
  parameters.Error(absl::StrCat("the scene exceeds the limit of ", limits_.triangles_max,
                                " triangles (triangles_max)"));
  return false;
}

bool ShapeTable::AddMesh(TriangleMesh mesh, ParameterList& parameters, int32_t* index) {
  if (!ChargeTriangles(mesh.indices.size() / 3, parameters)) return false;
  if (!ChargeMemory(MeshBytes(mesh), parameters.location())) return false;
  *index = static_cast<int32_t>(scene_->meshes.size());
  scene_->meshes.push_back(std::move(mesh));
  return true;
}

bool ShapeTable::SetBilinearMesh(ParameterList& parameters, ShapeDescription* shape) {
  BilinearMesh mesh;
  mesh.positions = parameters.GetTriples("P", ParameterType::kPoint3);
  mesh.normals = parameters.GetTriples("N", ParameterType::kNormal);
  mesh.uvs = parameters.GetPoints2("uv");
  parameters.RejectUnsupported("emissionfilename",
                               "Sheaf has no emission from images; give the light one colour");
  parameters.NoteWithoutEffect("faceIndices", "Sheaf has no ptex textures");
  if (mesh.positions.empty()) {
    parameters.Error(absl::StrCat(parameters.owner(), " needs \"point3 P\", its vertices"));
    parameters.Find("indices");
    return false;
  }
  const size_t vertex_count = mesh.positions.size();
  bool is_good = SetIndices(parameters, kPatch, &mesh);
  is_good = CheckCountOf(parameters, "N", mesh.normals, vertex_count) && is_good;
  is_good = CheckCountOf(parameters, "uv", mesh.uvs, vertex_count) && is_good;
  if (!is_good) return false;
  if (!ChargeTriangles(mesh.indices.size() / 2, parameters)) return false;
  if (!ChargeMemory(MeshBytes(mesh), parameters.location())) return false;
  shape->shape = BilinearMeshShape{static_cast<int32_t>(scene_->bilinear_meshes.size())};
  scene_->bilinear_meshes.push_back(std::move(mesh));
  return true;
}

bool ShapeTable::SetCurve(ParameterList& parameters, ShapeDescription* shape) {
  CurveSet curves;
  if (!ReadCurve(parameters, &curves)) return false;
  if (shape->area_light != kNone) {
    parameters.Error(absl::StrCat(parameters.owner(),
                                  ": curves cannot be area lights, in pbrt-v4 neither; use spheres "
                                  "or a mesh, or take the curves out of the AreaLightSource"));
    return false;
  }
  // A segment counts as two triangles, the ribbon's.
  if (!ChargeTriangles(2 * curves.size(), parameters)) return false;
  if (!ChargeMemory(CurveBytes(curves), parameters.location())) return false;
  shape->shape = CurveShape{static_cast<int32_t>(scene_->curve_sets.size())};
  scene_->curve_sets.push_back(std::move(curves));
  return true;
}

bool ShapeTable::JoinCurves(const std::vector<int32_t>& earlier, const ShapeDescription& shape) {
  const auto* added = std::get_if<CurveShape>(&shape.shape);
  if (added == nullptr) return false;
  const CurveSet& from = scene_->curve_sets[added->curves];
  const size_t reach = std::min(earlier.size(), kJoinReachMax);
  for (size_t i = 1; i <= reach; ++i) {
    const ShapeDescription& other = scene_->shapes[earlier[earlier.size() - i]];
    const auto* curves = std::get_if<CurveShape>(&other.shape);
    if (curves == nullptr || scene_->curve_sets[curves->curves].kind != from.kind ||
        other.material != shape.material || other.has_alpha != shape.has_alpha ||
        other.alpha.texture != shape.alpha.texture || other.alpha.value != shape.alpha.value ||
        other.reverse_orientation != shape.reverse_orientation ||
        !IsSamePlace(other.world_from_object, shape.world_from_object)) {
      continue;
    }
    CurveSet& to = scene_->curve_sets[curves->curves];
    Append(from.points, &to.points);
    Append(from.widths, &to.widths);
    Append(from.normals, &to.normals);
    scene_->curve_sets.pop_back();
    memory_bytes_ -= sizeof(ShapeDescription);
    return true;
  }
  return false;
}

bool ShapeTable::SetSphere(ParameterList& parameters, ShapeDescription* shape) {
  SphereShape sphere;
  sphere.radius = parameters.GetFloat("radius", 1);
  const float z_min = parameters.GetFloat("zmin", -sphere.radius);
  const float z_max = parameters.GetFloat("zmax", sphere.radius);
  sphere.phi_max_degrees = std::clamp(parameters.GetFloat("phimax", 360), 0.f, 360.f);
  if (!(sphere.radius > 0)) {
    parameters.Error(
        absl::StrCat(parameters.owner(), ": radius ", sphere.radius, " must be greater than 0"));
    return false;
  }
  sphere.z_min = std::clamp(std::min(z_min, z_max), -sphere.radius, sphere.radius);
  sphere.z_max = std::clamp(std::max(z_min, z_max), -sphere.radius, sphere.radius);
  shape->shape = sphere;
  return true;
}

bool ShapeTable::SetDisk(ParameterList& parameters, ShapeDescription* shape) {
  DiskShape disk;
  disk.radius = parameters.GetFloat("radius", 1);
  disk.inner_radius = parameters.GetFloat("innerradius", 0);
  disk.height = parameters.GetFloat("height", 0);
  disk.phi_max_degrees = std::clamp(parameters.GetFloat("phimax", 360), 0.f, 360.f);
  if (!(disk.radius > 0) || !(disk.inner_radius >= 0) || !(disk.inner_radius < disk.radius)) {
    parameters.Error(absl::StrCat(parameters.owner(), ": needs 0 <= innerradius < radius, but has ",
                                  disk.inner_radius, " and ", disk.radius));
    return false;
  }
  shape->shape = disk;
  return true;
}

bool ShapeTable::SetCylinder(ParameterList& parameters, ShapeDescription* shape) {
  CylinderShape cylinder;
  cylinder.radius = parameters.GetFloat("radius", 1);
  const float z_min = parameters.GetFloat("zmin", -1);
  const float z_max = parameters.GetFloat("zmax", 1);
  cylinder.z_min = std::min(z_min, z_max);
  cylinder.z_max = std::max(z_min, z_max);
  cylinder.phi_max_degrees = std::clamp(parameters.GetFloat("phimax", 360), 0.f, 360.f);
  if (!(cylinder.radius > 0) || !(cylinder.z_min < cylinder.z_max)) {
    parameters.Error(absl::StrCat(parameters.owner(),
                                  ": needs radius > 0 and zmin other than zmax, but has radius ",
                                  cylinder.radius, " and z from ", z_min, " to ", z_max));
    return false;
  }
  shape->shape = cylinder;
  return true;
}

}  // namespace sheaf
