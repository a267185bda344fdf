// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/pbrt/statements/shape_table.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/load_phases.h"
#include "common/base/memory_room.h"
#include "common/scene/formats/ply_reader.h"
#include "common/scene/loop_subdivision.h"
#include "common/scene/pbrt/statements/curve_reader.h"
#include "common/scene/pbrt/statements/level_set_reader.h"
#include "common/scene/pbrt/statements/mesh_parameters.h"
#include "common/scene/pbrt/statements/supported_names.h"

namespace sheaf {
namespace {

// Memory per triangle while a surface is refined: both levels' faces, edges and vertices.
constexpr uint64_t kRefinedTriangleBytes = 160;
// How many shapes back JoinCurves searches: curves of a few materials may alternate.
constexpr size_t kJoinReachMax = 8;

bool IsSamePlace(const TransformOverTime& a, const TransformOverTime& b) {
  return a.start == b.start && a.end == b.end && a.start_time == b.start_time &&
         a.end_time == b.end_time;
}
template <typename T>
void Append(const std::vector<T>& from, std::vector<T>* to) {
  to->insert(to->end(), from.begin(), from.end());
}
void NoteImprecision(ParameterList& parameters, const std::vector<Vec3f>& positions,
                     const std::vector<uint32_t>& indices, size_t corners) {
  const std::optional<std::string> why = WhyImprecise(positions, indices, corners);
  if (why.has_value()) parameters.Note(absl::StrCat(parameters.owner(), ": ", *why));
}
uint64_t CurveBytes(const CurveSet& curves) {
  return (curves.points.size() + curves.normals.size()) * sizeof(Vec3f) +
         curves.widths.size() * sizeof(float);
}

}  // namespace

bool ShapeTable::ChargeMemory(uint64_t size_bytes, SourceLocation location) {
  const bool was_within = memory_bytes_ <= limits_.memory_bytes_max;
  memory_bytes_ += size_bytes;
  if (memory_bytes_ <= limits_.memory_bytes_max) return true;
  if (was_within) {
    diagnostics_->MemoryError(
        location,
        absl::StrCat("reading the scene takes more than ", FormatMemory(limits_.memory_bytes_max),
                     ", which is ", limits_.memory_limit,
                     "; make the scene smaller, or raise the limit"));
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
  } else if (type == "levelset") {
    is_good = SetLevelSet(parameters, shape);
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
    parameters.Error(absl::StrCat(
        parameters.owner(), " is not supported",
        SupportedNamesHint(type, {"trianglemesh", "plymesh", "loopsubdiv", "bilinearmesh",
                                  "levelset", "sphere", "disk", "cylinder", "curve"})));
    return false;
  }
  parameters.ReportUnused();
  return is_good && ChargeMemory(sizeof(ShapeDescription), parameters.location());
}

bool ShapeTable::SetTriangleMesh(ParameterList& parameters, ShapeDescription* shape) {
  TriangleMesh mesh;
  MeshOrigin at{CanMoveOrigin(shape->world_from_object)};
  if (!ReadTriangles(parameters, &mesh, &at)) return false;
  if (!ReadVertexSteps(parameters, at, &mesh)) return false;
  MoveOrigin(at.origin, &shape->world_from_object);
  MeshShape mesh_shape;
  if (!AddMesh(std::move(mesh), parameters, &mesh_shape.mesh)) return false;
  return FinishMesh(parameters, shape, mesh_shape);
}

std::optional<TriangleMesh> ShapeTable::ReadPlyFiles(const std::vector<std::string>& names,
                                                     PlyColors colors, ParameterList& parameters,
                                                     MeshOrigin* at) {
  std::optional<TriangleMesh> mesh;
  std::vector<uint32_t> fans;  // Fans of the first step; kept if there are more.
  for (size_t i = 0; i < names.size(); ++i) {
    const Parameter& parameter =
        *parameters.Find(i == 0 ? std::string("filename") : absl::StrCat("filename", i));
    const absl::StatusOr<std::string> path = files_->PathToRead(names[i]);
    // Later steps share the origin of the first.
    const std::optional<Vec3d> origin =
        at->may_move && i == 0 ? std::nullopt : std::optional(at->origin);
    absl::StatusOr<PlyMesh> read = absl::UnknownError("");
    if (path.ok()) {
      const PhaseTimer timer(LoadPhase::kMeshes);
      read = ReadPly(*path, limits_, origin, i == 0 ? colors : PlyColors::kSkip);
    }
    const absl::Status status = path.ok() ? read.status() : path.status();
    if (!status.ok()) {
      const std::string text = absl::StrCat("cannot be read: ", names[i], ": ", status.message());
      if (absl::IsResourceExhausted(status)) {
        diagnostics_->MemoryError(
            parameter.location,
            absl::StrCat(parameters.owner(), ": parameter \"", parameter.name, "\" ", text));
      } else {
        parameters.ErrorAt(parameter, text);
      }
      return std::nullopt;
    }
    for (const PlySkipped& skipped : read->skipped) {
      AddSkipped(names[i], parameter.location, skipped);
    }
    TriangleMesh* step = &read->mesh;
    if (!mesh.has_value()) {
      at->origin = read->origin;
      if (names.size() > 1) fans = read->FanIndices();
      mesh = std::move(*step);
      mesh->file = names[i];
      continue;
    }
    if (step->positions.size() != mesh->positions.size() || read->FanIndices() != fans ||
        step->normals.empty() != mesh->normals.empty()) {
      parameters.ErrorAt(
          parameter,
          absl::StrCat("does not fit \"filename\": ", names[i],
                       " must have the same vertices and faces, with normals if that has them"));
      return std::nullopt;
    }
    mesh->steps.push_back({std::move(step->positions), std::move(step->normals)});
  }
  if (mesh.has_value()) DropEqualSteps(&*mesh);
  return mesh;
}

void ShapeTable::AddSkipped(const std::string& file, SourceLocation location,
                            const PlySkipped& skipped) {
  const auto [entry, is_new] =
      skipped_.try_emplace(std::pair(skipped.before, skipped.after),
                           SkippedInFiles{file, location, skipped, /*file_count=*/1});
  if (is_new) return;
  entry->second.first.count += skipped.count;
  ++entry->second.file_count;
}

void ShapeTable::ReportSkipped() {
  for (const auto& [text, skipped] : skipped_) {
    const PlySkipped& first = skipped.first;
    const std::string line = first.line > 0 ? absl::StrCat(":", first.line) : "";
    const std::string files = skipped.file_count > 1
                                  ? absl::StrCat(" (the sum of ", skipped.file_count,
                                                 " files, of which this is the first)")
                                  : "";
    const std::string count = first.count > 0 ? absl::StrCat(first.count) : "";
    const std::string whole = absl::StrCat("shape \"plymesh\": ", skipped.file, line, ": ",
                                           first.before, count, first.after, files);
    if (first.is_warning) {
      diagnostics_->Warning(skipped.location, whole);
    } else {
      diagnostics_->Note(skipped.location, whole);
    }
  }
  skipped_.clear();
}

bool ShapeTable::SetPlyMesh(ParameterList& parameters, ShapeDescription* shape) {
  std::vector<std::string> names;
  for (int i = 0; i <= kVertexStepsMax; ++i) {
    const std::string filename =
        parameters.GetString(i == 0 ? std::string("filename") : absl::StrCat("filename", i), "");
    if (filename.empty()) break;
    names.push_back(CanonicalFileName(filename));
  }
  if (names.empty()) {
    parameters.Error(absl::StrCat(parameters.owner(), " needs \"string filename\""));
    return false;
  }
  const bool may_move = CanMoveOrigin(shape->world_from_object);
  const PlyColors colors =
      parameters.GetBool("vertexcolors", false) ? PlyColors::kRead : PlyColors::kSkip;
  const auto [entry, is_new] =
      mesh_of_files_.try_emplace({names, may_move, colors == PlyColors::kRead});
  FileMesh& known = entry->second;
  if (is_new) {
    known.at.may_move = may_move;
    std::optional<TriangleMesh> mesh = ReadPlyFiles(names, colors, parameters, &known.at);
    if (!mesh.has_value() || !AddMesh(*std::move(mesh), parameters, &known.mesh)) return false;
  }
  if (known.mesh == kNone) return false;  // Reported at its first use.
  MoveOrigin(known.at.origin, &shape->world_from_object);
  return FinishMesh(parameters, shape, MeshShape{known.mesh});
}

bool ShapeTable::SetLevelSet(ParameterList& parameters, ShapeDescription* shape) {
  const std::optional<LevelSetParameters> wanted = ReadLevelSetParameters(parameters);
  if (!wanted.has_value()) return false;
  const bool may_move = CanMoveOrigin(shape->world_from_object);
  const auto [entry, is_new] = mesh_of_files_.try_emplace({wanted->Key(), may_move, false});
  FileMesh& known = entry->second;
  if (is_new) {
    known.at.may_move = may_move;
    std::optional<TriangleMesh> mesh =
        ReadLevelSet(*wanted, limits_, parameters, *files_, diagnostics_, &known.at);
    if (!mesh.has_value() || !AddMesh(*std::move(mesh), parameters, &known.mesh)) return false;
  }
  if (known.mesh == kNone) return false;  // Reported at its first use.
  MoveOrigin(known.at.origin, &shape->world_from_object);
  return FinishMesh(parameters, shape, MeshShape{known.mesh});
}

bool ShapeTable::FinishMesh(ParameterList& parameters, ShapeDescription* shape, MeshShape mesh) {
  const bool has_displacement = parameters.Has("displacement");
  mesh.displacement = textures_->GetFloatInput(parameters, "displacement", 0);
  for (const char* name : {"displacement.edgelength", "edgelength"}) {
    const float edge_length = parameters.GetFloat(name, mesh.edge_length);
    if (!(edge_length > 0 && std::isfinite(edge_length))) {
      parameters.ErrorAt(*parameters.Find(name), "must be greater than 0");
      return false;
    }
    mesh.edge_length = edge_length;
    if (!has_displacement) parameters.NoteWithoutEffect(name, "it is for displacement");
  }
  mesh.edge_length *= displacement_edge_scale_;
  shape->shape = mesh;
  if (!Deforms(scene_->meshes[static_cast<size_t>(mesh.mesh)])) return true;
  if (shape->area_light != kNone) {
    parameters.Error(absl::StrCat(parameters.owner(),
                                  ": a mesh that deforms cannot be an area light; remove it from "
                                  "the AreaLightSource, or give it one set of vertices"));
    return false;
  }
  if (mesh.IsDisplaced()) {
    parameters.ErrorAt(*parameters.Find("displacement"),
                       "is not supported for a mesh that deforms; displace the files of its steps");
    return false;
  }
  return true;
}

bool ShapeTable::SetLoopSubdivision(ParameterList& parameters, ShapeDescription* shape) {
  TriangleMesh control;
  MeshOrigin at{CanMoveOrigin(shape->world_from_object)};
  control.positions = ReadPositions(parameters, &at);
  MoveOrigin(at.origin, &shape->world_from_object);
  const int32_t levels = parameters.GetInteger("levels", 3);
  parameters.NoteWithoutEffect("scheme", "loop is the only scheme");
  if (control.positions.empty() || levels < 0) {
    parameters.Error(absl::StrCat(parameters.owner(),
                                  " needs \"point3 P\", its vertices, and levels "
                                  "of 0 or more"));
    parameters.Find("indices");
    return false;
  }
  if (!ReadTriangleIndices(parameters, &control)) return false;
  if (!HasRoomToRefine(control.indices.size() / 3, levels, parameters)) return false;
  absl::StatusOr<TriangleMesh> mesh =
      SubdivideLoop(control.positions, control.indices, levels, limits_.triangles_max);
  if (!mesh.ok()) {
    parameters.Error(absl::StrCat(parameters.owner(), ": ", mesh.status().message()));
    return false;
  }
  MeshShape mesh_shape;
  if (!AddMesh(std::move(*mesh), parameters, &mesh_shape.mesh)) return false;
  return FinishMesh(parameters, shape, mesh_shape);
}

bool ShapeTable::HasRoomToRefine(uint64_t triangle_count, int32_t levels,
                                 ParameterList& parameters) {
  uint64_t count = triangle_count;
  for (int32_t level = 0; level < levels && count <= limits_.triangles_max; ++level) count *= 4;
  if (count > limits_.triangles_max) return true;  // Refining reports it.
  const uint64_t used = std::min(memory_bytes_, limits_.memory_bytes_max);
  const uint64_t room = limits_.memory_bytes_max - used;
  if (count * kRefinedTriangleBytes <= room) return true;
  diagnostics_->MemoryError(
      parameters.location(),
      absl::StrCat(parameters.owner(), ": ", levels, " levels make ", count, " triangles of its ",
                   triangle_count, ", which take ", FormatMemory(count * kRefinedTriangleBytes),
                   " while they are refined; ", FormatMemory(room), " remain of ",
                   limits_.memory_limit,
                   "; reduce the levels, each takes four times the memory, or raise the limit"));
  return false;
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
  NoteImprecision(parameters, mesh.positions, mesh.indices, 3);
  *index = static_cast<int32_t>(scene_->meshes.size());
  scene_->meshes.push_back(std::move(mesh));
  return true;
}

bool ShapeTable::SetBilinearMesh(ParameterList& parameters, ShapeDescription* shape) {
  BilinearMesh mesh;
  parameters.NoteWithoutEffect("emissionfilename",
                               "it defines how pbrt-v4 samples points of a light; the emission is "
                               "the AreaLightSource's \"filename\", by which Sheaf samples them");
  MeshOrigin at{CanMoveOrigin(shape->world_from_object)};
  if (!ReadPatches(parameters, &mesh, &at)) return false;
  MoveOrigin(at.origin, &shape->world_from_object);
  NoteImprecision(parameters, mesh.positions, mesh.indices, 4);
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
                                  ": curves cannot be area lights, as in pbrt-v4; use spheres or a "
                                  "mesh, or remove the curves from the AreaLightSource"));
    return false;
  }
  // A segment counts as two triangles, those of the ribbon.
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
        other.material != shape.material || other.matte_name != shape.matte_name ||
        other.has_alpha != shape.has_alpha || other.alpha.texture != shape.alpha.texture ||
        other.alpha.value != shape.alpha.value || other.invisible != shape.invisible ||
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
