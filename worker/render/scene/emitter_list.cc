// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Converts emissive shapes to the input of the light table.
#include "worker/render/scene/emitter_list.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>
#include <variant>

#include "worker/render/geometry/emission_cells.h"

namespace sheaf::render {
namespace {

// Maximum relative difference in length, and deviation from a right angle, of a transform's axes
// for which a sphere stays a sphere. Allows for transforms that a scene file gives with six digits.
constexpr double kSimilarityTolerance = 1e-5;

// Returns the factor of a light's color where its shape has the given total area. luminance: the
// mean of the image; 1 for a color, whose own luminance multiplies the power, as in pbrt-v4.
float ScaleOf(const AreaLightDescription& light, double luminance, double area) {
  if (!(light.scale.power_w > 0)) return light.scale.scale;
  // A diffuse emitter's power is pi times area times radiance, per side.
  const double sides = light.two_sided ? 2 : 1;
  const double power_now = std::numbers::pi * area * sides * luminance;
  if (!(power_now > 0)) return 0;
  return static_cast<float>(light.scale.scale * static_cast<double>(light.scale.power_w) /
                            power_now);
}

// Maximum number of cells along a face's edge, and in a mesh.
constexpr uint32_t kCellsMax = 64;
constexpr size_t kCellsOfMeshMax = size_t{1} << 14;
// Finer cells are used only if they reduce the noise by this factor.
constexpr double kWorthwhileGain = 1.25;

Vec3d TriangleCross(const BakedMesh& mesh, const uint32_t* t) {
  const Vec3d p0 = ToDouble(mesh.positions[t[0]]);
  return Cross(ToDouble(mesh.positions[t[1]]) - p0, ToDouble(mesh.positions[t[2]]) - p0);
}

using FaceUvs = std::array<Vec2f, 3>;

FaceUvs UvsOf(const BakedMesh& mesh, const uint32_t* t) {
  if (mesh.uvs.empty()) return {Vec2f{0, 0}, Vec2f{1, 0}, Vec2f{1, 1}};
  return {mesh.uvs[t[0]], mesh.uvs[t[1]], mesh.uvs[t[2]]};
}

// b: barycentric coordinates of v1 and v2.
Vec3f PointOfFace(const TriangleEmitter& face, Vec2d b) {
  const Vec3d v0 = ToDouble(face.v0);
  return ToFloat(v0 + (ToDouble(face.v1) - v0) * b.x + (ToDouble(face.v2) - v0) * b.y);
}
Vec2f UvOfFace(const FaceUvs& uvs, Vec2d b) {
  return uvs[0] + static_cast<float>(b.x) * (uvs[1] - uvs[0]) +
         static_cast<float>(b.y) * (uvs[2] - uvs[0]);
}

// Approximates the mean as the luminance of the box about the cell's corners, which is positive if
// the cell emits anywhere.
double MeanOfCell(const EmissionMap& map, const Vec2f (&uv)[3]) {
  return map.MeanLuminance({std::fmin(uv[0].x, std::fmin(uv[1].x, uv[2].x)),
                            std::fmin(uv[0].y, std::fmin(uv[1].y, uv[2].y))},
                           {std::fmax(uv[0].x, std::fmax(uv[1].x, uv[2].x)),
                            std::fmax(uv[0].y, std::fmax(uv[1].y, uv[2].y))});
}

// Returns the noise of light from a mesh (second moment of an estimate over its squared mean,
// without the geometry terms) where each face is cut into counts[i]^2 cells that are chosen by
// their mean. The finest grid gives the variation inside a cell.
std::vector<double> NoiseOfCells(const BakedMesh& mesh, const EmissionMap& map, uint32_t finest,
                                 const std::vector<uint32_t>& counts) {
  std::vector<double> means(counts.size(), 0), noise(counts.size(), 0);
  std::vector<std::array<double, 2>> cells;
  for (size_t i = 0; i < mesh.indices.size(); i += 3) {
    const uint32_t* t = &mesh.indices[i];
    const FaceUvs uvs = UvsOf(mesh, t);
    const double area = Length(TriangleCross(mesh, t)) / (finest * finest);
    std::vector<double> values;
    for (uint32_t cell = 0; cell < finest * finest; ++cell) {
      const std::array<Vec2d, 3> b = CellCorners(finest, cell);
      const Vec2f uv[3] = {UvOfFace(uvs, b[0]), UvOfFace(uvs, b[1]), UvOfFace(uvs, b[2])};
      values.push_back(MeanOfCell(map, uv));
    }
    for (size_t k = 0; k < counts.size(); ++k) {
      cells.assign(counts[k] * counts[k], {0, 0});
      for (uint32_t cell = 0; cell < finest * finest; ++cell) {
        const std::array<Vec2d, 3> b = CellCorners(finest, cell);
        const Vec2d center = (b[0] + b[1] + b[2]) * (1.0 / 3);
        auto& [sum, squares] = cells[CellAt(counts[k], center.x, center.y)];
        sum += values[cell] * area;
        squares += values[cell] * values[cell] * area;
      }
      const double cell_area = area * finest * finest / (counts[k] * counts[k]);
      for (const auto& [sum, squares] : cells) {
        means[k] += sum;
        // Chosen in proportion to sum, then uniformly: the mean square is squares * cell_area /
        // sum.
        if (sum > 0) noise[k] += squares * cell_area / sum;
      }
    }
  }
  for (size_t k = 0; k < counts.size(); ++k) noise[k] = means[k] > 0 ? noise[k] / means[k] : 1;
  return noise;
}

// Returns the number of cells along an edge into which each face of the mesh is cut.
uint16_t ChooseCells(const BakedMesh& mesh, const EmissionMap& map) {
  const size_t faces = mesh.indices.size() / 3;
  std::vector<uint32_t> counts = {1};
  while (counts.back() < kCellsMax &&
         faces * 4 * counts.back() * counts.back() <= kCellsOfMeshMax) {
    counts.push_back(2 * counts.back());
  }
  if (counts.size() == 1) return 1;
  const std::vector<double> noise = NoiseOfCells(mesh, map, counts.back(), counts);
  size_t best = 0;
  for (size_t k = 1; k < counts.size(); ++k) {
    if (noise[k] * kWorthwhileGain < noise[best]) best = k;
  }
  return static_cast<uint16_t>(counts[best]);
}

}  // namespace

Emission EmitterList::EmissionOf(int32_t light, double area) const {
  const AreaLightDescription& description = LightAt(light);
  const EmissionMap* map = MapOf(light);
  if (map == nullptr) return {description.radiance, ScaleOf(description, 1, area), light};
  Emission mean;
  mean.spectrum_scale = ScaleOf(description, map->mean_luminance(), area);
  mean.rgb = Rgb::Gray(static_cast<float>(map->mean_luminance()) * mean.spectrum_scale);
  return mean;
}

const EmissionMap* EmitterList::MapOf(int32_t light) const {
  const auto index = static_cast<size_t>(light);
  return index < input_.maps.size() ? input_.maps[index].get() : nullptr;
}

bool EmitterList::IsAlwaysCutOut(const Surface& surface) const {
  const FloatInput& alpha = scene_.shapes[static_cast<size_t>(surface.shape)].alpha;
  if (alpha.texture == kNone) return alpha.value == 0;
  const auto* constant =
      std::get_if<ConstantTexture>(&scene_.textures[static_cast<size_t>(alpha.texture)].texture);
  return constant != nullptr && constant->value == 0;
}

std::optional<EmissionDetail> EmitterList::DetailOf(const Surface& surface, int32_t light,
                                                    const Emission& mean) const {
  const bool has_map = MapOf(light) != nullptr;
  if (!has_map && !surface.has_alpha) return std::nullopt;
  EmissionDetail detail;
  if (has_map) {
    detail.map = light;
    detail.map_scale = mean.spectrum_scale;
  }
  detail.is_unseen = surface.has_alpha && IsAlwaysCutOut(surface);
  if (surface.has_alpha && !detail.is_unseen) detail.cut_out = surface.shape;
  return detail;
}

void EmitterList::AddFace(const BakedMesh& mesh, const uint32_t* t, TriangleEmitter emitter,
                          const EmissionDetail* detail) {
  const bool flips = TriangleFacing(mesh, t, TriangleCross(mesh, t)) < 0;
  const auto add = [&](TriangleEmitter e, const EmissionDetail* its_detail) {
    if (flips) std::swap(e.v1, e.v2);
    if (its_detail != nullptr) {
      triangle_details_.resize(input_.triangles.size(), kNone);
      triangle_details_.push_back(static_cast<int32_t>(input_.details.size()));
      input_.details.push_back(*its_detail);
      if (flips) std::swap(input_.details.back().uv[1], input_.details.back().uv[2]);
    }
    input_.triangles.push_back(e);
  };
  emitter.v0 = mesh.positions[t[0]];
  emitter.v1 = mesh.positions[t[1]];
  emitter.v2 = mesh.positions[t[2]];
  if (detail == nullptr) return add(emitter, nullptr);
  const FaceUvs uvs = UvsOf(mesh, t);
  if (detail->map == kNone) {
    EmissionDetail whole = *detail;
    std::copy(uvs.begin(), uvs.end(), whole.uv);
    return add(emitter, &whole);
  }
  const EmissionMap& map = *input_.maps[static_cast<size_t>(detail->map)];
  const uint32_t count = mesh.surface.emission_cells;
  for (uint32_t cell = 0; cell < count * count; ++cell) {
    const std::array<Vec2d, 3> corners = CellCorners(count, cell);
    EmissionDetail part = *detail;
    TriangleEmitter e = emitter;
    Vec3f* const vertices[3] = {&e.v0, &e.v1, &e.v2};
    for (size_t c = 0; c < 3; ++c) {
      *vertices[c] = PointOfFace(emitter, corners[c]);
      part.uv[c] = UvOfFace(uvs, corners[c]);
    }
    e.radiance.rgb = Rgb::Gray(static_cast<float>(MeanOfCell(map, part.uv)) * detail->map_scale);
    add(e, &part);
  }
}

uint32_t EmitterList::AddMesh(int32_t light, BakedMesh* mesh) {
  double area = 0;
  for (size_t i = 0; i < mesh->indices.size(); i += 3) {
    area += 0.5 * Length(TriangleCross(*mesh, &mesh->indices[i]));
  }
  const Emission radiance = EmissionOf(light, area);
  if (radiance.rgb.IsBlack()) return kNoEmitter;
  const std::optional<EmissionDetail> detail = DetailOf(mesh->surface, light, radiance);
  if (detail && detail->map != kNone) {
    mesh->surface.emission_cells = ChooseCells(*mesh, *MapOf(light));
  }
  TriangleEmitter emitter;
  emitter.radiance = radiance;
  emitter.two_sided = LightAt(light).two_sided;
  const auto first = static_cast<uint32_t>(input_.triangles.size());
  for (size_t i = 0; i < mesh->indices.size(); i += 3) {
    AddFace(*mesh, &mesh->indices[i], emitter, detail ? &*detail : nullptr);
  }
  return first;
}

bool EmitterList::IsSampled(const Quadric& q) {
  if (q.kind == Quadric::Kind::kCylinder) return false;
  const Affine& m = q.target_from_object;
  const double x = Length(m.x), y = Length(m.y), z = Length(m.z);
  const double tolerance = kSimilarityTolerance * x;
  const bool round_xy = std::fabs(x - y) <= tolerance && std::fabs(Dot(m.x, m.y)) <= tolerance * y;
  if (q.kind == Quadric::Kind::kDisk) return round_xy && q.phi_max >= 2 * std::numbers::pi;
  return round_xy && std::fabs(x - z) <= tolerance && std::fabs(Dot(m.x, m.z)) <= tolerance * z &&
         std::fabs(Dot(m.y, m.z)) <= tolerance * z && !q.is_partial;
}

uint32_t EmitterList::AddQuadric(const Quadric& q, const Surface& surface, int32_t light) {
  const bool flips = surface.flips_normal;
  const Affine& m = q.target_from_object;
  const double scale = Length(m.x);
  const bool two_sided = LightAt(light).two_sided;
  const auto add_detail = [&](const Emission& mean, size_t index, std::vector<int32_t>* details) {
    std::optional<EmissionDetail> detail = DetailOf(surface, light, mean);
    if (!detail) return;
    detail->quadric = static_cast<int32_t>(input_.quadrics.size());
    input_.quadrics.push_back(q);
    details->resize(index, kNone);
    details->push_back(static_cast<int32_t>(input_.details.size()));
    input_.details.push_back(*detail);
  };
  if (q.kind == Quadric::Kind::kSphere) {
    const double radius = q.radius * scale;
    const Emission radiance = EmissionOf(light, 4 * std::numbers::pi * radius * radius);
    if (radiance.rgb.IsBlack()) return kNoEmitter;
    add_detail(radiance, input_.spheres.size(), &sphere_details_);
    input_.spheres.push_back({m.offset, radius, radiance, two_sided, flips});
    return static_cast<uint32_t>(input_.spheres.size() - 1);
  }
  const double outer = q.radius * scale, inner = q.inner_radius * scale;
  const Emission radiance = EmissionOf(light, std::numbers::pi * (outer - inner) * (outer + inner));
  if (radiance.rgb.IsBlack()) return kNoEmitter;
  add_detail(radiance, input_.disks.size(), &disk_details_);
  const Vec3d normal = Normalize(q.object_from_target.TransposedVector({0, 0, 1}));
  input_.disks.push_back({m.Point({0, 0, q.z_min}), flips ? -normal : normal, Normalize(m.x), outer,
                          inner, radiance, two_sided});
  return static_cast<uint32_t>(input_.disks.size() - 1);
}

void EmitterList::AssignIds(GeometryGroup* world) const {
  const auto first_sphere = static_cast<uint32_t>(input_.triangles.size());
  const auto first_disk = static_cast<uint32_t>(first_sphere + input_.spheres.size());
  for (BakedQuadric& q : world->quadrics) {
    if (q.surface.emitter == kNoEmitter) continue;
    q.surface.emitter += q.quadric.kind == Quadric::Kind::kSphere ? first_sphere : first_disk;
  }
}

LightTableInput EmitterList::Take() {
  if (!input_.details.empty()) {
    triangle_details_.resize(input_.triangles.size(), kNone);
    sphere_details_.resize(input_.spheres.size(), kNone);
    disk_details_.resize(input_.disks.size(), kNone);
    input_.detail_of = std::move(triangle_details_);
    for (const std::vector<int32_t>* more : {&sphere_details_, &disk_details_}) {
      input_.detail_of.insert(input_.detail_of.end(), more->begin(), more->end());
    }
  }
  return std::move(input_);
}

}  // namespace sheaf::render
