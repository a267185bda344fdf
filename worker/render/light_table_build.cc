// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneDescription > LightTable: places the lights in render space, reads environment maps, and
// gives the light choice its bounds. Units and the meaning of `power` and `illuminance` are
// pbrt-v4's.
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "common/base/status.h"
#include "common/image/image_io.h"
#include "common/math/elementary.h"
#include "worker/render/equal_area_map.h"
#include "worker/render/light_table.h"
#include "worker/render/light_table_impl.h"

namespace sheaf::render {
namespace {

// Environment maps beyond this make the tables of running sums larger than a worker should hold.
constexpr int kEnvironmentMapSizeMax = 8192;
// How far a rotation's columns may be from orthogonal and of equal length, relative.
constexpr double kRotationTolerance = 1e-4;
// The same of a spot light's transform, where the choice of lights is to know its cone; and what is
// added to the cone's cosine for it.
constexpr float kSimilarityTolerance = 1e-5f, kConeSlack = 1e-4f;

double RadiansOf(float degrees) { return static_cast<double>(degrees) * (kPi / 180); }

absl::Status ErrorAt(const SceneDescription& scene, SourceLocation location,
                     const std::string& what) {
  return absl::InvalidArgumentError(absl::StrCat(FormatLocation(scene, location), ": ", what));
}

// |L| as the choice of lights counts it: of either sign, and positive wherever a channel is not 0.
float StrengthOf(Rgb c) {
  if (!IsFinite(c)) return 0;
  return Luminance({std::fabs(c.r), std::fabs(c.g), std::fabs(c.b)});
}

// --- Bounds of emitters ------------------------------------------------------------------------

// An emitter that the choice never picks: no area, or values no sample may carry.
LightBounds NoLight() { return {.kind = LightBounds::Kind::kPlanar, .strength = 0}; }

LightBounds BoundsOf(const TriangleEmitter& t) {
  const Vec3d v0 = ToDouble(t.v0), e1 = ToDouble(t.v1) - v0, e2 = ToDouble(t.v2) - v0;
  const Vec3d normal = Cross(e1, e2);
  const double doubled_area = Length(normal);
  if (!(doubled_area > 0) || !std::isfinite(doubled_area)) return NoLight();
  const Vec3d center = v0 + (e1 + e2) / 3.0;
  const double radius =
      std::max({Length(v0 - center), Length(v0 + e1 - center), Length(v0 + e2 - center)});
  return {.kind = LightBounds::Kind::kPlanar,
          .two_sided = t.two_sided,
          .center = ToFloat(center),
          .normal = ToFloat(normal / doubled_area),
          .radius = static_cast<float>(radius),
          .area = static_cast<float>(0.5 * doubled_area),
          .strength = StrengthOf(t.radiance.rgb)};
}

LightBounds BoundsOf(const SphereEmitter& s) {
  const double area = kPi * s.radius * s.radius;
  if (!(s.radius > 0) || !std::isfinite(area) || !std::isfinite(LengthSquared(s.center))) {
    return NoLight();
  }
  return {.kind = LightBounds::Kind::kSphere,
          .center = ToFloat(s.center),
          .radius = static_cast<float>(s.radius),
          .area = static_cast<float>(area),
          .strength = StrengthOf(s.radiance.rgb)};
}

LightBounds BoundsOf(const DiskEmitter& d) {
  const double area = kPi * (d.radius - d.inner_radius) * (d.radius + d.inner_radius);
  if (!(area > 0) || !std::isfinite(area) || !std::isfinite(LengthSquared(d.center))) {
    return NoLight();
  }
  return {.kind = LightBounds::Kind::kPlanar,
          .two_sided = d.two_sided,
          .center = ToFloat(d.center),
          .normal = ToFloat(d.normal),
          .radius = static_cast<float>(d.radius),
          .area = static_cast<float>(area),
          .strength = StrengthOf(d.radiance.rgb)};
}

// Whether angles are kept, to far within kConeSlack.
bool IsSimilarity(const Vec3f (&rows)[3]) {
  const float scale = LengthSquared(rows[0]);
  for (size_t i = 0; i < 3; ++i) {
    if (!(std::fabs(LengthSquared(rows[i]) - scale) <= kSimilarityTolerance * scale &&
          std::fabs(Dot(rows[i], rows[(i + 1) % 3])) <= kSimilarityTolerance * scale)) {
      return false;
    }
  }
  return true;
}

LightBounds BoundsOf(const DeltaLight& light) {
  if (light.kind == DeltaLight::Kind::kDistant) {
    return {.kind = LightBounds::Kind::kInfinite, .strength = StrengthOf(light.emission.rgb)};
  }
  LightBounds bounds{.kind = LightBounds::Kind::kPoint,
                     .center = ToFloat(light.position),
                     .strength = StrengthOf(light.emission.rgb)};
  if (light.kind == DeltaLight::Kind::kSpot && IsSimilarity(light.light_from_render)) {
    const Vec3f(&rows)[3] = light.light_from_render;
    bounds.normal =
        Normalize(light.axis.x * rows[0] + light.axis.y * rows[1] + light.axis.z * rows[2]);
    bounds.cos_end = light.cos_end - kConeSlack;
  }
  return bounds;
}

LightBounds BoundsOf(const InfiniteEmitter& light) {
  const float mean = light.map ? static_cast<float>(light.map->mean_luminance()) * light.scale
                               : StrengthOf(light.radiance.rgb);
  return {.kind = LightBounds::Kind::kInfinite,
          .strength = static_cast<float>(kPi) * std::fabs(mean)};
}

// --- Lights of the scene file ------------------------------------------------------------------

// Index of the spectrum.
int32_t AddSpectrum(const ScaledSpectrum& spectrum, LightTable::Impl* impl) {
  impl->spectra.push_back(
      {SpectralColor::Make(spectrum.color, ColorRole::kIlluminant), spectrum.scale});
  return static_cast<int32_t>(impl->spectra.size() - 1);
}

// Reads one light after the other; the first error stays.
class SceneLightReader {
 public:
  SceneLightReader(const SceneDescription& scene, Vec3d render_origin_world, FileSource& files,
                   bool spectral, LightTable::Impl* impl)
      : scene_(scene),
        render_origin_world_(render_origin_world),
        files_(files),
        spectral_(spectral),
        impl_(impl) {}

  absl::Status Read(const LightDescription& light) {
    return std::visit([&](const auto& kind) { return Add(light, kind); }, light.light);
  }

 private:
  absl::Status Add(const LightDescription& light, const PointLight& point);
  absl::Status Add(const LightDescription& light, const SpotLight& spot);
  absl::Status Add(const LightDescription& light, const DistantLight& distant);
  absl::Status Add(const LightDescription& light, const InfiniteLight& infinite);
  absl::StatusOr<EnvironmentMap> ReadMap(const LightDescription& light, const std::string& file);
  absl::Status Keep(const LightDescription& light, DeltaLight delta);
  Emission AddEmission(const ColorSpec& color, float scale) {
    Emission emission{color.rgb * scale, kNone};
    if (spectral_) emission.spectrum = AddSpectrum({color, scale}, impl_);
    return emission;
  }

  const SceneDescription& scene_;
  Vec3d render_origin_world_;
  FileSource& files_;
  const bool spectral_;
  LightTable::Impl* impl_;
};

// The linear part of light_from_world, as rows.
bool InvertLinearPart(const Matrix4& world_from_light, Vec3f (*rows)[3]) {
  Matrix4 inverse;
  if (!Invert(world_from_light, &inverse)) return false;
  for (size_t i = 0; i < 3; ++i) {
    (*rows)[i] = ToFloat({inverse.m[i][0], inverse.m[i][1], inverse.m[i][2]});
  }
  return true;
}

// A black light adds nothing, and one that is not finite is an error.
absl::Status SceneLightReader::Keep(const LightDescription& light, DeltaLight delta) {
  if (!IsFinite(delta.emission.rgb) || !std::isfinite(LengthSquared(delta.position))) {
    return ErrorAt(
        scene_, light.location,
        "the light's position or brightness is not finite; check scale, power and transform");
  }
  if (!delta.emission.rgb.IsBlack()) impl_->deltas.push_back(delta);
  return absl::OkStatus();
}

absl::Status SceneLightReader::Add(const LightDescription& light, const PointLight& point) {
  float scale = light.scale.scale;
  if (light.scale.power_w > 0) scale *= light.scale.power_w / static_cast<float>(4 * kPi);
  DeltaLight delta;
  delta.kind = DeltaLight::Kind::kPoint;
  delta.position = TransformPoint(light.world_from_light, point.from) - render_origin_world_;
  delta.emission = AddEmission(point.intensity, scale);
  return Keep(light, delta);
}

absl::Status SceneLightReader::Add(const LightDescription& light, const SpotLight& spot) {
  const Vec3d axis = spot.to - spot.from;
  if (!(LengthSquared(axis) > 0)) {
    return ErrorAt(scene_, light.location,
                   "spot light: \"from\" and \"to\" are the same point; move one of them");
  }
  DeltaLight delta;
  delta.kind = DeltaLight::Kind::kSpot;
  delta.position = TransformPoint(light.world_from_light, spot.from) - render_origin_world_;
  delta.axis = ToFloat(Normalize(axis));
  const double cos_end = Cos(RadiansOf(spot.cone_angle_degrees));
  const double cos_start = Cos(RadiansOf(spot.cone_angle_degrees - spot.cone_delta_angle_degrees));
  delta.cos_end = static_cast<float>(cos_end);
  delta.cos_start = static_cast<float>(cos_start);
  if (!InvertLinearPart(light.world_from_light, &delta.light_from_render)) {
    return ErrorAt(scene_, light.location,
                   "spot light: the transform cannot be inverted; remove the scale of 0");
  }
  float scale = light.scale.scale;
  if (light.scale.power_w > 0) {
    // The smooth step's mean over its range of cosines is exactly one half.
    const double per_intensity = 2 * kPi * ((1 - cos_start) + 0.5 * (cos_start - cos_end));
    scale *= static_cast<float>(static_cast<double>(light.scale.power_w) / per_intensity);
  }
  delta.emission = AddEmission(spot.intensity, scale);
  return Keep(light, delta);
}

absl::Status SceneLightReader::Add(const LightDescription& light, const DistantLight& distant) {
  const Vec3d to_light = TransformVector(light.world_from_light, distant.from - distant.to);
  if (!(LengthSquared(to_light) > 0)) {
    return ErrorAt(scene_, light.location,
                   "distant light: \"from\" and \"to\" are the same point; move one of them");
  }
  DeltaLight delta;
  delta.kind = DeltaLight::Kind::kDistant;
  delta.to_light = ToFloat(Normalize(to_light));
  const float illuminance = distant.illuminance_lx > 0 ? distant.illuminance_lx : 1;
  delta.emission = AddEmission(distant.radiance, light.scale.scale * illuminance);
  return Keep(light, delta);
}

absl::StatusOr<EnvironmentMap> SceneLightReader::ReadMap(const LightDescription& light,
                                                         const std::string& file) {
  absl::StatusOr<std::string> path = files_.LocalPath(file);
  if (!path.ok()) return Annotate(path.status(), FormatLocation(scene_, light.location));
  absl::StatusOr<FloatImage> image = ReadImage(*path);
  if (!image.ok()) return Annotate(image.status(), FormatLocation(scene_, light.location));
  const std::string what = absl::StrCat("environment map \"", file, "\" ");
  if (image->width != image->height || image->width < 1 || image->width > kEnvironmentMapSizeMax) {
    return ErrorAt(
        scene_, light.location,
        absl::StrCat(what, "is ", image->width, " x ", image->height,
                     " pixels, but equal-area maps are square and at most ", kEnvironmentMapSizeMax,
                     " wide; convert it (latitude-longitude maps: imgtool makeequiarea)"));
  }
  if (image->channels != 1 && image->channels < 3) {
    return ErrorAt(scene_, light.location,
                   absl::StrCat(what, "has ", image->channels,
                                " channels, but needs 1 (grey) or R, G and B; convert it"));
  }
  std::vector<Rgb> texels(static_cast<size_t>(image->width) * static_cast<size_t>(image->height));
  const auto channel = [&](int x, int y, int c) {
    const float value = image->At(x, y, image->channels == 1 ? 0 : c);
    return image->is_integer ? DecodeSrgb(value) : value;
  };
  for (int y = 0, i = 0; y < image->height; ++y) {
    for (int x = 0; x < image->width; ++x, ++i) {
      texels[static_cast<size_t>(i)] = {channel(x, y, 0), channel(x, y, 1), channel(x, y, 2)};
    }
  }
  absl::StatusOr<EnvironmentMap> map = EnvironmentMap::Make(image->width, texels);
  if (!map.ok()) return ErrorAt(scene_, light.location, what + std::string(map.status().message()));
  return map;
}

// Equal areas of the map must stay equal on the sphere: a rotation, a mirror, a uniform scale.
bool MakeRotation(const Matrix4& world_from_light, Vec3f (*rows)[3]) {
  Vec3d column[3];
  for (size_t i = 0; i < 3; ++i) {
    column[i] = {world_from_light.m[0][i], world_from_light.m[1][i], world_from_light.m[2][i]};
  }
  const double length = Length(column[0]);
  if (!(length > 0) || !std::isfinite(length)) return false;
  for (size_t i = 0; i < 3; ++i) {
    const double off_length = std::fabs(Length(column[i]) - length);
    const double off_angle = std::fabs(Dot(column[i], column[(i + 1) % 3])) / length;
    if (!(off_length <= kRotationTolerance * length && off_angle <= kRotationTolerance * length)) {
      return false;
    }
    (*rows)[i] = ToFloat(column[i] / Length(column[i]));
  }
  return true;
}

absl::Status SceneLightReader::Add(const LightDescription& light, const InfiniteLight& infinite) {
  InfiniteEmitter emitter;
  if (infinite.file.empty()) {
    float scale = light.scale.scale;
    if (infinite.illuminance_lx > 0) scale *= infinite.illuminance_lx / static_cast<float>(kPi);
    emitter.radiance = AddEmission(infinite.radiance, scale);
    if (!IsFinite(emitter.radiance.rgb)) {
      return ErrorAt(scene_, light.location, "infinite light: the radiance is not finite");
    }
    if (!emitter.radiance.rgb.IsBlack()) impl_->infinites.push_back(std::move(emitter));
    return absl::OkStatus();
  }
  absl::StatusOr<EnvironmentMap> map = ReadMap(light, infinite.file);
  if (!map.ok()) return map.status();
  if (!MakeRotation(light.world_from_light, &emitter.light_from_render)) {
    return ErrorAt(scene_, light.location,
                   "infinite light: its transform stretches or shears the environment map; use "
                   "rotations, mirrors and uniform scales only");
  }
  emitter.scale = light.scale.scale;
  // A black map is no light; its illuminance cannot be scaled to anything either.
  if (!(map->mean_luminance() > 0) || emitter.scale == 0) return absl::OkStatus();
  if (infinite.illuminance_lx > 0) {
    const double illuminance = map->PbrtIlluminance();
    if (!(illuminance > 0)) {
      return ErrorAt(scene_, light.location,
                     "infinite light: \"illuminance\" is given, but the map is black where z > 0");
    }
    emitter.scale *= static_cast<float>(static_cast<double>(infinite.illuminance_lx) / illuminance);
  }
  emitter.map = std::move(*map);
  impl_->infinites.push_back(std::move(emitter));
  return absl::OkStatus();
}

std::vector<LightBounds> AllBounds(const LightTable::Impl& impl) {
  std::vector<LightBounds> bounds;
  bounds.reserve(impl.first_infinite() + impl.infinites.size());
  for (const TriangleEmitter& t : impl.triangles) bounds.push_back(BoundsOf(t));
  for (const SphereEmitter& s : impl.spheres) bounds.push_back(BoundsOf(s));
  for (const DiskEmitter& d : impl.disks) bounds.push_back(BoundsOf(d));
  for (const DeltaLight& light : impl.deltas) bounds.push_back(BoundsOf(light));
  for (const InfiniteEmitter& light : impl.infinites) bounds.push_back(BoundsOf(light));
  return bounds;
}

}  // namespace

absl::StatusOr<std::unique_ptr<LightTable>> LightTable::Build(const SceneDescription& scene,
                                                              LightTableInput input,
                                                              FileSource& files) {
  std::unique_ptr<LightTable> table(new LightTable());
  table->impl_ = std::make_unique<Impl>();
  Impl& impl = *table->impl_;
  impl.triangles = std::move(input.triangles);
  impl.spheres = std::move(input.spheres);
  impl.disks = std::move(input.disks);
  if (input.spectral) {
    PrepareUpsampling();
    for (const ScaledSpectrum& spectrum : input.spectra) AddSpectrum(spectrum, &impl);
  }
  SceneLightReader reader(scene, input.render_origin_world, files, input.spectral, &impl);
  for (const LightDescription& light : scene.lights) {
    const absl::Status status = reader.Read(light);
    if (!status.ok()) return status;
  }
  std::vector<LightBounds> bounds = AllBounds(impl);
  impl.empty = std::none_of(bounds.begin(), bounds.end(),
                            [](const LightBounds& light) { return light.strength > 0; });
  impl.choice = LightChoice(std::move(bounds));
  return table;
}

}  // namespace sheaf::render
