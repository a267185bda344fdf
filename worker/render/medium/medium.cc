// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/medium/medium.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/base/vector_bytes.h"
#include "common/scene/half_space.h"
#include "common/scene/pbrt/statements/subsurface_reflectance.h"
#include "worker/render/geometry/bounds.h"
#include "worker/render/geometry/deforming_mesh.h"
#include "worker/render/geometry/leak_guard.h"
#include "worker/render/medium/grid_files.h"

namespace sheaf::render {
namespace {

// Returns the side of a surface, relative to its normals, that it encloses.
EnclosedSide SideEnclosedBy(const BakedMesh& mesh) {
  const EnclosedSide side = EnclosedSideOf(mesh.positions, mesh.indices);
  if (side == EnclosedSide::kNeither) return side;
  std::optional<float> facing;
  for (size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
    const uint32_t* t = &mesh.indices[i];
    const Vec3d p = ToDouble(mesh.positions[t[0]]);
    const Vec3d cross =
        Cross(ToDouble(mesh.positions[t[1]]) - p, ToDouble(mesh.positions[t[2]]) - p);
    const float its = TriangleFacing(mesh, t, cross);
    if (facing.value_or(its) != its) return EnclosedSide::kNeither;
    facing = its;
  }
  const bool is_back = (side == EnclosedSide::kBack) == (facing.value_or(1) > 0);
  return is_back ? EnclosedSide::kBack : EnclosedSide::kFront;
}
EnclosedSide SideEnclosedBy(const BakedQuadric& baked, const ShapeDescription& shape) {
  const auto* sphere = std::get_if<SphereShape>(&shape.shape);
  const bool is_closed = sphere != nullptr && sphere->phi_max_degrees >= 360 &&
                         std::min(sphere->z_min, sphere->z_max) <= -sphere->radius &&
                         std::max(sphere->z_min, sphere->z_max) >= sphere->radius;
  if (!is_closed) return EnclosedSide::kNeither;
  return baked.surface.flips_normal ? EnclosedSide::kFront : EnclosedSide::kBack;
}

// Finds the media that are bounded in every direction because only closed surfaces bound them. A
// ray in one of them that hits nothing has missed a surface.
std::vector<bool> FindBounded(const SceneDescription& scene, const SceneGeometry& geometry) {
  std::vector<bool> is_enclosed(scene.media.size(), false), is_open(scene.media.size(), false);
  const auto add = [&](const Surface& surface, EnclosedSide side) {
    if (!surface.media.Separates()) return;
    const auto [inside, outside] = surface.media;
    const int32_t enclosed = side == EnclosedSide::kFront ? outside : inside;
    if (enclosed != kNone) is_enclosed[static_cast<size_t>(enclosed)] = true;
    // The medium around a closed body that faces outward may be bounded, too.
    if (side == EnclosedSide::kBack) return;
    for (const int32_t medium : {inside, outside}) {
      const bool is_within = side == EnclosedSide::kFront && medium == outside;
      if (medium != kNone && !is_within) is_open[static_cast<size_t>(medium)] = true;
    }
  };
  for (const GeometryGroup& group : geometry.groups) {
    for (const BakedMesh& mesh : group.meshes) {
      if (mesh.surface.media.Separates()) add(mesh.surface, SideEnclosedBy(mesh));
    }
    for (const BakedQuadric& quadric : group.quadrics) {
      add(quadric.surface,
          SideEnclosedBy(quadric, scene.shapes[static_cast<size_t>(quadric.surface.shape)]));
    }
    for (const BakedPatches& patches : group.patches) add(patches.surface, EnclosedSide::kNeither);
  }
  std::vector<bool> is_bounded(scene.media.size());
  for (size_t i = 0; i < is_bounded.size(); ++i) {
    is_bounded[i] = is_enclosed[i] && !is_open[i] && scene.camera.medium != static_cast<int32_t>(i);
  }
  return is_bounded;
}

// Finds subsurface media with a refracting boundary.
std::vector<bool> FindHidden(const SceneDescription& scene) {
  std::vector<bool> is_hidden(scene.media.size(), false);
  for (const MaterialDescription& description : scene.materials) {
    const auto* material = std::get_if<SubsurfaceMaterial>(&description.material);
    if (material == nullptr || material->eta.IsMatched()) continue;
    is_hidden[static_cast<size_t>(material->medium)] = true;
  }
  return is_hidden;
}

// Optical thickness across a box up to which most rays through it are thin.
constexpr double kThickness = 2;

// Approximate distance of the light from the box; 0 where they overlap.
double DistanceTo(const HeterogeneousMedium& medium, const LightBounds& light) {
  const IndexBox& box = medium.majorants().box();
  const Vec3d center = ToDouble(light.center);
  const Vec3d at = Inverse(medium.render_from_index()).Point(center);
  Vec3d nearest;
  for (size_t a = 0; a < 3; ++a) nearest[a] = std::min(std::max(at[a], box.lo[a]), box.hi[a]);
  const double distance = Length(medium.render_from_index().Point(nearest) - center);
  return std::max(0.0, distance - static_cast<double>(light.radius));
}

// Whether a light has a place, as gathering needs.
bool HasPlacedLight(const LightTable& lights) {
  for (uint32_t light = 0; light < lights.light_count(); ++light) {
    const LightBounds bounds = lights.BoundsOf(light);
    if (bounds.kind != LightBounds::Kind::kInfinite && bounds.strength > 0) return true;
  }
  return false;
}

// Whether gathering may pay off: the box is thin, or the light is within a mean free path of it.
bool MayPay(const HeterogeneousMedium& medium, double extinction, const LightTable& lights) {
  const IndexBox& box = medium.majorants().box();
  const double across = Length(medium.render_from_index().Vector(box.hi - box.lo));
  for (uint32_t light = 0; light < lights.light_count(); ++light) {
    const LightBounds bounds = lights.BoundsOf(light);
    if (bounds.kind == LightBounds::Kind::kInfinite || !(bounds.strength > 0)) continue;
    if (extinction * across < kThickness || DistanceTo(medium, bounds) * extinction < 1)
      return true;
  }
  return false;
}

// Bodies of one medium that have boxes of their own; more share one. Every line is intersected with
// each.
constexpr size_t kBodiesMax = 64;

void AddBox(const Bounds& box, const Affine& transform, Bounds* bounds) {
  const Vec3d lower = box.lower(), upper = box.upper();
  for (int corner = 0; corner < 8; ++corner) {
    bounds->Add(transform.Point({corner & 1 ? upper.x : lower.x, corner & 2 ? upper.y : lower.y,
                                 corner & 4 ? upper.z : lower.z}));
  }
}

bool MayBound(const Surface& surface, int32_t medium) {
  return surface.media.Separates() &&
         (surface.media.inside == medium || surface.media.outside == medium);
}

// The boxes, in the group's space, of its surfaces that bound the medium.
std::vector<Bounds> BoxesIn(const GeometryGroup& group, int32_t medium) {
  std::vector<Bounds> boxes;
  for (const BakedMesh& mesh : group.meshes) {
    if (!MayBound(mesh.surface, medium)) continue;
    Bounds& box = boxes.emplace_back();
    for (size_t step = 0; step <= mesh.steps.size(); ++step) {
      const std::vector<Vec3f>& positions = PositionsOfStep(mesh, step);
      for (const uint32_t i : mesh.indices) box.Add(ToDouble(positions[i]));
    }
  }
  for (const BakedQuadric& quadric : group.quadrics) {
    if (!MayBound(quadric.surface, medium)) continue;
    Bounds& box = boxes.emplace_back();
    for (const Vec3f& corner : QuadricBounds(quadric.quadric)) box.Add(ToDouble(corner));
  }
  return boxes;
}

// Boxes of render space, over the whole shutter interval, that together contain a medium which only
// closed surfaces bound.
std::vector<Bounds> BodiesOf(const SceneGeometry& geometry, int32_t medium) {
  std::vector<Bounds> bodies = BoxesIn(geometry.groups[0], medium);
  for (const PlacedGroup& placed : geometry.still) {
    for (const Bounds& box : BoxesIn(geometry.groups[placed.group], medium)) {
      AddBox(box, placed.render_from_group, &bodies.emplace_back());
    }
  }
  for (const PlacedGroup& placed : geometry.moving) {
    if (BoxesIn(geometry.groups[placed.group], medium).empty()) continue;
    Bounds& body = bodies.emplace_back();
    for (uint32_t step = 0; step < kMotionStepCount; ++step) {
      const PlacedBounds box = BoundsOfMoving(geometry, placed, step);
      body.Add(ToDouble(box.lower));
      body.Add(ToDouble(box.upper));
    }
  }
  if (bodies.size() <= kBodiesMax) return bodies;
  Bounds all;
  for (const Bounds& body : bodies) {
    all.Add(body.lower());
    all.Add(body.upper());
  }
  return {all};
}

}  // namespace

absl::StatusOr<std::unique_ptr<MediumTable>> MediumTable::Build(const SceneDescription& scene,
                                                                const SceneGeometry& geometry,
                                                                MediumVelocities velocities,
                                                                FileSource& files,
                                                                const Options& options) {
  if (scene.media.size() > kMediaMax) {
    return absl::ResourceExhaustedError(absl::StrCat("the scene has ", scene.media.size(),
                                                     " media, more than the limit of ", kMediaMax));
  }
  const std::vector<bool> is_bounded = FindBounded(scene, geometry);
  const std::vector<bool> is_hidden = FindHidden(scene);
  const double shutter_time = static_cast<double>(scene.camera.shutter_close) -
                              static_cast<double>(scene.camera.shutter_open);
  GridFiles grid_files(&files, options.thread_count, options.volume_memory_bytes_max);
  std::vector<Medium> media;
  for (const MediumDescription& description : scene.media) {
    Medium medium;
    if (!description.IsHomogeneous()) {
      Affine placement = AffineOf(description.world_from_medium);
      placement.offset = placement.offset - geometry.render_origin_world;
      const std::string where = absl::StrCat(FormatLocation(scene, description.location),
                                             ": medium \"", description.name, "\"");
      Movement movement{std::move(velocities[media.size()]),
                        shutter_time * static_cast<double>(description.velocity_scale)};
      auto parts =
          MakeParts(where, description, placement, std::move(movement), grid_files, options);
      if (!parts.ok()) return parts.status();
      medium.parts = *std::move(parts);
      auto medium_emission = MakeEmission(where, description, placement, grid_files, options);
      if (!medium_emission.ok()) return medium_emission.status();
      medium.medium_emission = *std::move(medium_emission);
      medium.is_heterogeneous = true;
      medium.has_emissive_grid = medium.medium_emission != nullptr;
    }
    medium.scale = description.scale;
    medium.sigma_a = description.sigma_a.rgb * description.scale;
    medium.sigma_s = description.sigma_s.rgb * description.scale;
    const float g = description.g;
    medium.SetForms(g);
    medium.emits =
        description.IsHomogeneous() && description.emits && description.radiance_scale > 0;
    medium.is_subsurface = description.is_subsurface;
    medium.is_hidden = is_hidden[media.size()];
    // A path that leaves a subsurface medium but hits no boundary is an error, for any mesh.
    medium.is_bounded = is_bounded[media.size()] || description.is_subsurface;
    medium.radiance_scale = description.radiance_scale;
    if (medium.emits) medium.radiance = description.radiance.rgb * description.radiance_scale;
    if (options.spectral) {
      medium.sigma_a_spectrum = SpectralColor::Make(description.sigma_a, ColorRole::kUnbounded);
      medium.sigma_s_spectrum = SpectralColor::Make(description.sigma_s, ColorRole::kUnbounded);
      if (description.reflectance) SetSpectra(*description.reflectance, g, &medium);
      if (medium.emits) {
        medium.radiance_spectrum =
            SpectralColor::Make(description.radiance, ColorRole::kIlluminant);
      }
    }
    media.push_back(std::move(medium));
  }
  // Sorts by g first, so that equal phase functions are adjacent.
  std::vector<size_t> order(media.size());
  std::iota(order.begin(), order.end(), size_t{0});
  const auto key = [&media](size_t i) {
    const Medium& m = media[i];
    return std::tuple(m.In(MediumForm::kTrue).g, m.is_subsurface, m.is_hidden, m.sigma_s.r,
                      m.sigma_s.g, m.sigma_s.b, m.sigma_a.r, m.sigma_a.g, m.sigma_a.b, m.radiance.r,
                      m.radiance.g, m.radiance.b);
  };
  std::stable_sort(order.begin(), order.end(),
                   [&key](size_t a, size_t b) { return key(a) < key(b); });
  auto table = std::make_unique<MediumTable>();
  table->pages_ = grid_files.pages();
  table->index_of_.resize(media.size());
  for (const size_t i : order) {
    table->index_of_[i] = static_cast<uint16_t>(table->media_.size());
    media[i].members = {table->index_of_[i]};
    table->media_.push_back(std::move(media[i]));
  }
  table->emissive_volumes_ = EmissiveVolumeSampler(table->EmissiveDensities());
  if (scene.camera.medium != kNone) {
    const bool fits = table->camera_media_.Add(table->IndexOf(scene.camera.medium));
    SHEAF_CHECK(fits);
  }
  return table;
}

void MediumTable::SetSpectra(const SubsurfaceReflectance& reflectance, float g, Medium* medium) {
  const auto free_path = [path = SpectralColor::Make(reflectance.free_path, ColorRole::kUnbounded),
                          scale = reflectance.scale](double nm) {
    return std::max(kFreePathMin, path.At(static_cast<float>(nm)) * scale);
  };
  if (reflectance.texture != kNone) {  // Scatters only; paths apply the texture.
    medium->sigma_a_spectrum = {};
    medium->sigma_s_spectrum =
        SpectralColor::Tabulate([&](double nm) { return 1 / free_path(nm); });
    return;
  }
  const AlbedoCurve curve(static_cast<double>(reflectance.eta), static_cast<double>(g));
  const SpectralColor color = SpectralColor::Make(reflectance.color, ColorRole::kReflectance);
  const auto albedo = [&](double nm) { return curve.At(color.At(static_cast<float>(nm))); };
  medium->sigma_a_spectrum =
      SpectralColor::Tabulate([&](double nm) { return (1 - albedo(nm)) / free_path(nm); });
  medium->sigma_s_spectrum =
      SpectralColor::Tabulate([&](double nm) { return albedo(nm) / free_path(nm); });
}

uint64_t MediumTable::memory_bytes() const {
  uint64_t bytes = VectorBytes(media_) + emissive_volumes_.memory_bytes();
  for (const Medium& medium : media_) {
    for (const Part& part : medium.parts) bytes += part.density.memory_bytes();
    if (medium.medium_emission != nullptr) bytes += medium.medium_emission->memory_bytes();
    if (medium.merged) bytes += medium.merged->memory_bytes();
  }
  return bytes;
}

void MediumTable::ChooseEquiangular(const LightTable& lights, EquiangularMode mode) {
  gathers_always_ = mode == EquiangularMode::kAlways;
  if (mode == EquiangularMode::kNever) return;
  // Means are looked up all over a grid: for nothing, no page is read.
  if (!gathers_always_ && !HasPlacedLight(lights)) return;
  for (uint16_t index = 0; index < media_.size(); ++index) {
    Medium& medium = media_[index];
    bool scatters = false;
    for (uint16_t i = 0; i < medium.parts.size(); ++i) {
      const auto its = CoefficientsOf<Rgb>({index, i}, NoWavelengths{}, MediumForm::kTrue);
      const double mean = medium.parts[i].density.MeanDensity();
      medium.extinction +=
          mean * static_cast<double>(its.sigma_t.r + its.sigma_t.g + its.sigma_t.b) / 3;
      scatters = scatters || (!its.sigma_s.IsBlack() && mean > 0);
    }
    if (!scatters) continue;
    medium.gathers = gathers_always_ ||
                     std::any_of(medium.parts.begin(), medium.parts.end(), [&](const Part& part) {
                       return MayPay(part.density, medium.extinction, lights);
                     });
  }
  for (Medium& medium : media_) {
    if (!medium.merged) continue;
    medium.gathers = std::any_of(medium.members.begin(), medium.members.end(),
                                 [this](uint16_t member) { return Gathers(member); });
  }
}

MediumTable::EquiangularSpan MediumTable::EquiangularSpanOf(const MediumSet& media, Vec3d o,
                                                            Vec3d d, double length) const {
  EquiangularSpan hull;
  const auto add = [&](uint16_t medium) {
    if (!Gathers(medium)) return;
    hull.extinction += media_[medium].extinction;
    for (const Part& part : media_[medium].parts) {
      double begin = 0, end = length;
      if (!part.density.ClipToBox(o, d, &begin, &end)) continue;
      const bool is_first = hull.begin == hull.end;
      hull.begin = is_first ? begin : std::min(hull.begin, begin);
      hull.end = is_first ? end : std::max(hull.end, end);
    }
  };
  for (const uint16_t medium : media) {
    for (const uint16_t member : MembersOf(medium)) add(member);
  }
  return hull;
}

std::vector<EmissiveDensity> MediumTable::EmissiveDensities() const {
  std::vector<EmissiveDensity> sources;
  for (uint16_t medium = 0; medium < media_.size(); ++medium) {
    for (uint16_t part = 0; part < media_[medium].parts.size(); ++part) {
      const MediumEmission* medium_emission = MediumEmissionOf({medium, part});
      if (medium_emission == nullptr) continue;
      sources.push_back(
          {&DensityOf({medium, part}), medium_emission,
           CoefficientsOf<Rgb>({medium, part}, NoWavelengths{}, MediumForm::kTrue).sigma_a});
    }
  }
  return sources;
}

EmissionPoints MediumTable::MakeEmissionPoints(const SceneGeometry& geometry) const {
  std::vector<EmissionPoints::Body> bodies;
  for (size_t i = 0; i < index_of_.size(); ++i) {
    const Medium& medium = media_[index_of_[i]];
    if (!medium.emits || !medium.IsBody()) continue;
    const auto emission = static_cast<double>(Luminance(medium.radiance * medium.sigma_a));
    const auto extinction = static_cast<double>(Luminance(medium.sigma_a + medium.sigma_s));
    for (const Bounds& body : BodiesOf(geometry, static_cast<int32_t>(i))) {
      if (!body.empty()) bodies.push_back({body.lower(), body.upper(), emission, extinction});
    }
  }
  return EmissionPoints(EmissiveDensities(), bodies);
}

}  // namespace sheaf::render
