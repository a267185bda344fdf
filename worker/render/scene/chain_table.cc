// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/scene/chain_table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "common/math/elementary.h"

namespace sheaf::render {
namespace {

constexpr double kFullTurn = 2 * kPi;

Vec3d CrossOf(const BakedMesh& mesh, const uint32_t* t) {
  const Vec3d p0 = ToDouble(mesh.positions[t[0]]);
  return Cross(ToDouble(mesh.positions[t[1]]) - p0, ToDouble(mesh.positions[t[2]]) - p0);
}

// A point of the triangle, uniformly. Source: Turk 1990, "Generating Random Points in Triangles".
Vec3d OnTriangle(Vec3d corner, Vec3d e1, Vec3d e2, double u, double v) {
  const double root = std::sqrt(u);
  return corner + e1 * (root * (1 - v)) + e2 * (root * v);
}

// A point of the quadric: uniform on whole spheres and disks that are not distorted.
Vec3d OnQuadric(const Quadric& q, double u, double v) {
  const bool is_sphere = q.kind == Quadric::Kind::kSphere;
  const auto turn = SinCos((is_sphere || q.phi_max >= kFullTurn ? kFullTurn : q.phi_max) * u);
  Vec3d p;
  if (is_sphere) {
    const double z = 1 - 2 * v, r = std::sqrt(std::max(0.0, 1 - z * z));
    p = Vec3d{r * turn.cos, r * turn.sin, z} * q.radius;
  } else if (q.kind == Quadric::Kind::kDisk) {
    const double inner = q.inner_radius * q.inner_radius;
    const double r = std::sqrt(inner + v * (q.radius * q.radius - inner));
    p = Vec3d{r * turn.cos, r * turn.sin, q.z_min};
  } else {
    p = Vec3d{q.radius * turn.cos, q.radius * turn.sin, q.z_min + v * (q.z_max - q.z_min)};
  }
  return q.target_from_object.Point(p);
}

// Requires: the quadric is not distorted.
double LampArea(const Quadric& q) {
  const double scale = Length(q.target_from_object.x);
  const double area = q.kind == Quadric::Kind::kSphere
                          ? 4 * q.radius * q.radius
                          : q.radius * q.radius - q.inner_radius * q.inner_radius;
  return kPi * area * scale * scale;
}

// Whether lengths in all directions grow alike.
bool IsRound(const Quadric& q) {
  constexpr double kTolerance = 1e-5;
  const Affine& a = q.target_from_object;
  const double x = Length(a.x);
  return std::fabs(Length(a.y) - x) <= kTolerance * x &&
         std::fabs(Length(a.z) - x) <= kTolerance * x &&
         std::fabs(Dot(a.x, a.y)) <= kTolerance * x * x &&
         std::fabs(Dot(a.y, a.z)) <= kTolerance * x * x &&
         std::fabs(Dot(a.z, a.x)) <= kTolerance * x * x;
}

std::vector<bool> BitsOf(const std::vector<int32_t>& shapes) {
  std::vector<bool> bits;
  for (const int32_t shape : shapes) {
    bits.resize(std::max(bits.size(), static_cast<size_t>(shape) + 1));
    bits[shape] = true;
  }
  return bits;
}

}  // namespace

ChainTable::ChainTable(const ChainShapes& shapes, const SceneGeometry& geometry,
                       const LightTable& lights)
    : is_caster_(BitsOf(shapes.casters)) {
  const std::vector<bool> lamp_shapes = BitsOf(shapes.lamps);
  const auto is_lamp = [&](const Surface& surface) {
    return surface.emitter != kNoEmitter && surface.shape >= 0 &&
           static_cast<size_t>(surface.shape) < lamp_shapes.size() && lamp_shapes[surface.shape];
  };
  const GeometryGroup& world = geometry.groups[0];
  std::vector<double> powers;
  for (const BakedMesh& mesh : world.meshes) {
    if (IsCaster(mesh.surface.shape)) AddCaster(mesh);
    if (!is_lamp(mesh.surface)) continue;
    for (size_t i = 0; i < mesh.indices.size(); i += 3) {
      const uint32_t* t = &mesh.indices[i];
      const Vec3d corner = ToDouble(mesh.positions[t[0]]), cross = CrossOf(mesh, t);
      AddLamp({.emitter = mesh.surface.emitter + static_cast<uint32_t>(i / 3),
               .shape = mesh.surface.shape,
               .corner = corner,
               .e1 = ToDouble(mesh.positions[t[1]]) - corner,
               .e2 = ToDouble(mesh.positions[t[2]]) - corner,
               .area = 0.5 * Length(cross)},
              Normalize(cross), lights, &powers);
    }
  }
  for (const BakedQuadric& quadric : world.quadrics) {
    if (IsCaster(quadric.surface.shape)) AddCaster(quadric);
    if (!is_lamp(quadric.surface)) continue;
    const Quadric& q = quadric.quadric;
    AddLamp({.emitter = quadric.surface.emitter,
             .shape = quadric.surface.shape,
             .quadric = &q,
             .area = LampArea(q)},
            Normalize(q.object_from_target.TransposedVector({0, 0, 1})), lights, &powers);
  }
  lamp_choice_ = DiscreteDistribution(powers);
}

void ChainTable::AddCaster(const BakedMesh& mesh) {
  Caster caster{.shape = mesh.surface.shape, .mesh = &mesh};
  Vec3d lower = ToDouble(mesh.positions[mesh.indices[0]]), upper = lower;
  std::vector<double> areas;
  for (size_t i = 0; i < mesh.indices.size(); ++i) {
    const Vec3d p = ToDouble(mesh.positions[mesh.indices[i]]);
    for (size_t k = 0; k < 3; ++k) {
      lower[k] = std::min(lower[k], p[k]);
      upper[k] = std::max(upper[k], p[k]);
    }
    if (i % 3 == 0) areas.push_back(Length(CrossOf(mesh, &mesh.indices[i])));
  }
  caster.center = (lower + upper) * 0.5;
  caster.radius = 0.5 * Length(upper - lower);
  caster.areas = DiscreteDistribution(areas);
  if (!caster.areas.empty()) casters_.push_back(std::move(caster));
}

void ChainTable::AddCaster(const BakedQuadric& baked) {
  const Quadric& q = baked.quadric;
  const double height = q.kind == Quadric::Kind::kSphere
                            ? q.radius
                            : std::max(std::fabs(q.z_min), std::fabs(q.z_max));
  const Affine& a = q.target_from_object;
  const double scale = std::max({Length(a.x), Length(a.y), Length(a.z)});
  const bool is_sphere = q.kind == Quadric::Kind::kSphere;
  casters_.push_back({.shape = baked.surface.shape,
                      .center = a.offset,
                      .radius = scale * (is_sphere ? q.radius : std::hypot(q.radius, height)),
                      .is_ball = is_sphere && IsRound(q) && !q.is_partial,
                      .quadric = &q});
}

void ChainTable::AddLamp(const Lamp& lamp, Vec3d normal, const LightTable& lights,
                         std::vector<double>* powers) {
  double power = 0;
  const Vec3f n = ToFloat(normal);
  for (const Vec3f side : {n, -n}) {
    power += static_cast<double>(Luminance(lights.EmitterRadiance<Rgb>(lamp.emitter, n, side)));
  }
  is_lamp_.resize(std::max<size_t>(is_lamp_.size(), lamp.emitter + 1));
  is_lamp_[lamp.emitter] = power > 0;
  lamps_.push_back(lamp);
  powers->push_back(power * lamp.area);
}

ChainTable::LampPoint ChainTable::SampleLamp(float choice, Vec2f u) const {
  const size_t index = lamp_choice_.Sample(ExtendBits(choice, SaltOf(u)));
  const Lamp& lamp = lamps_[index];
  const double x = static_cast<double>(u.x), y = static_cast<double>(u.y);
  LampPoint point{.p = lamp.quadric != nullptr ? OnQuadric(*lamp.quadric, x, y)
                                               : OnTriangle(lamp.corner, lamp.e1, lamp.e2, x, y),
                  .pdf = lamp_choice_.Probability(index) / lamp.area,
                  .emitter = lamp.emitter,
                  .shape = lamp.shape,
                  .outward = {}};
  if (lamp.quadric != nullptr && lamp.quadric->kind == Quadric::Kind::kSphere) {
    point.outward = point.p - lamp.quadric->target_from_object.offset;
  }
  return point;
}

double ChainTable::WeightOf(const Caster& caster, Vec3d p, Vec3d n) const {
  const Vec3d to = caster.center - p;
  if (Dot(to, n) < -caster.radius * Length(n)) return 0;
  // Small casters are not chosen so rarely that their light would be noise.
  constexpr double kLeast = 0.05;
  const double size = caster.radius * caster.radius;
  return kLeast + size / std::max(size, LengthSquared(to));
}

std::optional<ChainTable::ChosenCaster> ChainTable::ChooseCaster(Vec3f at, Vec3d n,
                                                                 const ChainSeeds::OfLamp* seeds,
                                                                 double u) const {
  const Vec3d p = ToDouble(at);
  double sum = 0;
  for (const Caster& caster : casters_) sum += WeightOf(caster, p, n);
  if (!(sum > 0)) return std::nullopt;
  std::array<uint32_t, NearestPoints::kNearestMax> near{};
  const uint32_t count = seeds == nullptr || caster_count() == 1 ? 0 : seeds->all.Find(at, near);
  const auto is_of = [&](uint32_t caster) {
    return [this, caster](uint32_t id) { return (*seeds_)[id].caster == caster; };
  };
  const double by_angle = count == 0 ? 1 : 0.5;
  ChosenCaster chosen;
  for (uint32_t i = 0; i < caster_count(); ++i) {
    double probability = by_angle * WeightOf(casters_[i], p, n) / sum;
    if (count > 0) {
      const auto of_caster = std::count_if(near.begin(), near.begin() + count, is_of(i));
      probability += (1 - by_angle) * static_cast<double>(of_caster) / count;
    }
    if (probability > 0) chosen = {i, probability};
    if (u < probability) break;
    u -= probability;
  }
  return chosen;
}

std::optional<uint32_t> ChainTable::CasterOf(int32_t shape) const {
  for (uint32_t i = 0; i < caster_count(); ++i) {
    if (casters_[i].shape == shape) return i;
  }
  return std::nullopt;
}

void ChainTable::EnsureSeeds(const std::function<ChainSeeds()>& trace) const {
  std::call_once(seeds_once_, [&] { seeds_ = trace(); });
}

Vec3d ChainTable::SampleDirection(uint32_t index, Vec3d p, const double (&u)[3]) const {
  const Caster& caster = casters_[index];
  const Vec3d to = caster.center - p;
  const double distance_squared = LengthSquared(to);
  const double sin_squared = caster.radius * caster.radius / distance_squared;
  if (caster.is_ball && sin_squared < 1) {
    // Uniform in the cone of the ball, and more often near its edge, where chains turn quickly.
    constexpr double kAtEdge = 0.25;
    const double rest = u[0] / kAtEdge;
    const double part = rest < 1 ? 1 - rest * rest * rest : (u[0] - kAtEdge) / (1 - kAtEdge);
    // 1 - cos without cancellation.
    const double versine = part * sin_squared / (1 + std::sqrt(1 - sin_squared));
    const double sine = std::sqrt(std::max(0.0, versine * (2 - versine)));
    const auto turn = SinCos(kFullTurn * u[1]);
    const Vec3d axis = to * (1 / std::sqrt(distance_squared));
    const Vec3d x =
        Normalize(Cross(axis, std::fabs(axis.x) < 0.5 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0}));
    const Vec3d y = Cross(axis, x);
    return Normalize(axis * (1 - versine) + x * (sine * turn.cos) + y * (sine * turn.sin));
  }
  if (caster.mesh == nullptr) return Normalize(OnQuadric(*caster.quadric, u[0], u[1]) - p);
  const BakedMesh& mesh = *caster.mesh;
  const uint32_t* t = &mesh.indices[3 * caster.areas.Sample(u[2])];
  const Vec3d corner = ToDouble(mesh.positions[t[0]]);
  return Normalize(OnTriangle(corner, ToDouble(mesh.positions[t[1]]) - corner,
                              ToDouble(mesh.positions[t[2]]) - corner, u[0], u[1]) -
                   p);
}

}  // namespace sheaf::render
