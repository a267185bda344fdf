// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light/light_reader.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "common/base/status.h"
#include "common/math/elementary.h"
#include "worker/render/color/light_image.h"
#include "worker/render/light/intensity_map.h"
#include "worker/render/light/projected_image.h"
#include "worker/render/sampling/equal_area_map.h"

namespace sheaf::render {
namespace {

// Relative tolerance for the orthogonality and equal length of a rotation's columns.
constexpr double kRotationTolerance = 1e-4;
// A map that is stretched gets twice its size, for directions that move apart, up to this one.
constexpr int kStretchedMapSizeMax = 2048;

double RadiansOf(float degrees) { return static_cast<double>(degrees) * (kPi / 180); }

absl::Status ErrorAt(const SceneDescription& scene, SourceLocation location,
                     const std::string& what) {
  return absl::InvalidArgumentError(absl::StrCat(FormatLocation(scene, location), ": ", what));
}

// Reads the lights one by one; keeps the first error.
// Sums and products of radiance are made in float: beyond kRadianceMax they exceed what a sample
// may have, and below kRadianceMin they lose digits or vanish.
constexpr float kRadianceMax = 1e25f, kRadianceMin = 1e-25f;
absl::Status CheckRadiance(const SceneDescription& scene, SourceLocation location, float largest) {
  if (!(largest > 0)) return absl::OkStatus();
  if (largest > kRadianceMax) {
    return ErrorAt(scene, location,
                   absl::StrCat("the light's radiance of ", largest, " is above ", kRadianceMax,
                                ", too large for 32-bit numbers; scale all lights down"));
  }
  if (largest < kRadianceMin) {
    LogWarning(absl::StrCat(
        FormatLocation(scene, location), ": the light's radiance of ", largest, " is below ",
        kRadianceMin, ", where 32-bit numbers lose a part of its light; scale all lights up"));
  }
  return absl::OkStatus();
}

class SceneLightReader {
 public:
  SceneLightReader(const SceneDescription& scene, Vec3d render_origin_world, FileSource& files,
                   bool spectral, LightTable::Impl* impl)
      : scene_(scene),
        render_origin_world_(render_origin_world),
        images_(scene, files),
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
  absl::Status Add(const LightDescription& light, const GoniometricLight& goniometric);
  absl::Status Add(const LightDescription& light, const ProjectionLight& projection);
  absl::StatusOr<IntensityDistribution> ReadIntensities(const LightDescription& light,
                                                        const GoniometricLight& goniometric);
  absl::StatusOr<ProjectedImage> ReadProjectedImage(const LightDescription& light,
                                                    const ProjectionLight& projection);
  absl::StatusOr<LightImage> ReadSquareMap(const LightDescription& light, const std::string& file);
  absl::StatusOr<EnvironmentMap> ReadMap(const LightDescription& light, const std::string& file);
  SkyPortal MakePortal(const InfiniteLight& infinite, const InfiniteEmitter& emitter,
                       const EnvironmentMap& map) const;
  // peak: the factor of the emission in the direction where the light is brightest.
  template <typename Kind>
  absl::Status Keep(const LightDescription& light, const Kind& delta, Rgb peak = Rgb::Gray(1));
  Emission AddEmission(const ColorSpec& color, float scale) {
    return {color, scale, spectral_ ? impl_->AddSpectrum(color) : kNone};
  }

  const SceneDescription& scene_;
  Vec3d render_origin_world_;
  LightImages images_;
  const bool spectral_;
  LightTable::Impl* impl_;
  // Images are read once, however many lights use them: indices by file, and by field of view.
  std::map<std::string, size_t> intensity_of_file_;
  std::map<std::pair<std::string, float>, size_t> projection_of_file_;
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

// Drops a black light. Errors: a light whose values are not finite.
template <typename Kind>
absl::Status SceneLightReader::Keep(const LightDescription& light, const Kind& delta, Rgb peak) {
  bool is_finite = IsFinite(delta.emission.rgb * peak);
  if constexpr (!Kind::kIsDistant) {
    is_finite = is_finite && std::isfinite(LengthSquared(delta.position));
  }
  if (!is_finite) {
    return ErrorAt(
        scene_, light.location,
        "the light's position or brightness is not finite; check scale, power and transform");
  }
  if (!(delta.emission.rgb * peak).IsBlack()) impl_->deltas.push_back(delta);
  return absl::OkStatus();
}

absl::Status SceneLightReader::Add(const LightDescription& light, const PointLight& point) {
  float scale = light.scale.scale;
  if (light.scale.power_w > 0) scale *= light.scale.power_w / static_cast<float>(4 * kPi);
  PointEmitter delta;
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
  SpotEmitter delta;
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
    // The mean of the smooth step over its range of cosines is exactly one half.
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
  DistantEmitter delta;
  delta.to_light = ToFloat(Normalize(to_light));
  const float illuminance = distant.illuminance_lx > 0 ? distant.illuminance_lx : 1;
  delta.emission = AddEmission(distant.radiance, light.scale.scale * illuminance);
  return Keep(light, delta);
}

absl::StatusOr<LightImage> SceneLightReader::ReadSquareMap(const LightDescription& light,
                                                           const std::string& file) {
  absl::StatusOr<LightImage> image = images_.Read(light.location, file);
  if (image.ok() && image->width != image->height) {
    return ErrorAt(scene_, light.location,
                   absl::StrCat("\"", file, "\" is ", image->width, " x ", image->height,
                                " pixels, but equal-area maps are square; convert it "
                                "(latitude-longitude maps: imgtool makeequiarea)"));
  }
  return image;
}

absl::StatusOr<EnvironmentMap> SceneLightReader::ReadMap(const LightDescription& light,
                                                         const std::string& file) {
  absl::StatusOr<LightImage> image = ReadSquareMap(light, file);
  if (!image.ok()) return image.status();
  absl::StatusOr<EnvironmentMap> map = EnvironmentMap::Make(image->width, image->texels);
  if (!map.ok()) {
    return ErrorAt(
        scene_, light.location,
        absl::StrCat("environment map \"", file, "\" ", std::string(map.status().message())));
  }
  return map;
}

// Equal-area maps stay so only under rotations, mirrors and uniform scales; false for others.
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

// The map as seen through a transform that stretches or shears it, with the axes of the world. Each
// texel is the mean of the map over the directions that fall in it.
absl::StatusOr<EnvironmentMap> StretchedMap(const EnvironmentMap& map,
                                            const Matrix4& light_from_world) {
  const int size = std::max(map.size(), std::min(2 * map.size(), kStretchedMapSizeMax));
  constexpr int kSteps = 4;  // Directions along each side of a texel.
  std::vector<Rgb> texels;
  texels.reserve(static_cast<size_t>(size) * static_cast<size_t>(size));
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      Rgb sum;
      for (int k = 0; k < kSteps * kSteps; ++k) {
        const Vec2d st{(x + (k % kSteps + 0.5) / kSteps) / size,
                       (y + (k / kSteps + 0.5) / kSteps) / size};
        const Vec3d d = TransformVector(light_from_world, EqualAreaSquareToSphere(st));
        sum += map.Radiance(ToFloat(Normalize(d)));
      }
      texels.push_back(sum * (1.0f / (kSteps * kSteps)));
    }
  }
  return EnvironmentMap::Make(size, texels);
}

// emitter: with its rotation set.
SkyPortal SceneLightReader::MakePortal(const InfiniteLight& infinite,
                                       const InfiniteEmitter& emitter,
                                       const EnvironmentMap& map) const {
  Vec3d corners[4];
  for (size_t i = 0; i < 4; ++i) corners[i] = infinite.portal[i] - render_origin_world_;
  const Vec3f(&rows)[3] = emitter.light_from_render;
  return SkyPortal(corners, map.size(), map.mean_luminance(), [&](Vec3f d) {
    return static_cast<double>(
        Luminance(map.Radiance(Vec3f{Dot(rows[0], d), Dot(rows[1], d), Dot(rows[2], d)})));
  });
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
  emitter.scale = light.scale.scale;
  // Drops a black map; its illuminance cannot be scaled to any value either.
  if (!(map->mean_luminance() > 0) || emitter.scale == 0) return absl::OkStatus();
  if (infinite.illuminance_lx > 0) {
    const double illuminance = map->PbrtIlluminance();
    if (!(illuminance > 0)) {
      return ErrorAt(scene_, light.location,
                     "infinite light: \"illuminance\" is given, but the map is black where z > 0");
    }
    emitter.scale *= static_cast<float>(static_cast<double>(infinite.illuminance_lx) / illuminance);
  }
  if (!MakeRotation(light.world_from_light, &emitter.light_from_render)) {
    Matrix4 light_from_world;
    if (!Invert(light.world_from_light, &light_from_world)) {
      return ErrorAt(scene_, light.location,
                     "infinite light: the transform cannot be inverted; remove the scale of 0");
    }
    map = StretchedMap(*map, light_from_world);
    if (!map.ok()) return map.status();
    MakeRotation(Matrix4{}, &emitter.light_from_render);
  }
  if (infinite.portal.size() == 4) emitter.portal = MakePortal(infinite, emitter, *map);
  emitter.map = std::move(*map);
  impl_->infinites.push_back(std::move(emitter));
  return absl::OkStatus();
}

absl::StatusOr<IntensityDistribution> SceneLightReader::ReadIntensities(
    const LightDescription& light, const GoniometricLight& goniometric) {
  if (!goniometric.table.candelas.empty()) return PhotometricWeb(goniometric.table);
  absl::StatusOr<LightImage> image = ReadSquareMap(light, goniometric.file);
  if (!image.ok()) return image.status();
  std::vector<float> factors;
  factors.reserve(image->texels.size());
  for (const Rgb c : image->texels) factors.push_back((c.r + c.g + c.b) / 3);
  absl::StatusOr<IntensityMap> map = IntensityMap::Make(image->width, std::move(factors));
  if (!map.ok()) {
    return ErrorAt(scene_, light.location,
                   absl::StrCat("goniometric light: \"", goniometric.file, "\" ",
                                std::string(map.status().message())));
  }
  return *std::move(map);
}

absl::Status SceneLightReader::Add(const LightDescription& light,
                                   const GoniometricLight& goniometric) {
  if (goniometric.file.empty()) return Add(light, PointLight{goniometric.intensity, {}});
  const auto [known, is_new] =
      intensity_of_file_.try_emplace(goniometric.file, impl_->light_maps.intensities.size());
  if (is_new) {
    absl::StatusOr<IntensityDistribution> intensity = ReadIntensities(light, goniometric);
    if (!intensity.ok()) return intensity.status();
    impl_->light_maps.intensities.push_back(*std::move(intensity));
  }
  const IntensityDistribution& intensity = impl_->light_maps.intensities[known->second];
  const double mean = std::visit([](const auto& i) { return i.mean(); }, intensity);
  const float peak = std::visit([](const auto& i) { return i.peak(); }, intensity);
  // Drops a black map; no scale gives it power.
  if (!(mean > 0)) return absl::OkStatus();
  GoniometricEmitter delta;
  delta.position = TransformPoint(light.world_from_light, {0, 0, 0}) - render_origin_world_;
  if (!InvertLinearPart(light.world_from_light, &delta.light_from_render)) {
    return ErrorAt(scene_, light.location,
                   "goniometric light: the transform cannot be inverted; remove the scale of 0");
  }
  // The distribution's axis is +z, the light's is +y.
  std::swap(delta.light_from_render[1], delta.light_from_render[2]);
  float scale = light.scale.scale;
  if (light.scale.power_w > 0) {
    scale *= static_cast<float>(static_cast<double>(light.scale.power_w) / (4 * kPi * mean));
  }
  delta.emission = AddEmission(goniometric.intensity, scale);
  delta.image = known->second;
  return Keep(light, delta, Rgb::Gray(peak));
}

absl::StatusOr<ProjectedImage> SceneLightReader::ReadProjectedImage(
    const LightDescription& light, const ProjectionLight& projection) {
  absl::StatusOr<LightImage> image = images_.Read(light.location, projection.file);
  if (!image.ok()) return image.status();
  absl::StatusOr<ProjectedImage> projected = ProjectedImage::Make(
      image->width, image->height, std::move(image->texels), projection.fov_degrees);
  if (!projected.ok()) {
    return ErrorAt(scene_, light.location,
                   absl::StrCat("projection light: \"", projection.file, "\" ",
                                std::string(projected.status().message())));
  }
  return projected;
}

absl::Status SceneLightReader::Add(const LightDescription& light,
                                   const ProjectionLight& projection) {
  const auto [known, is_new] = projection_of_file_.try_emplace(
      {projection.file, projection.fov_degrees}, impl_->light_maps.projected.size());
  if (is_new) {
    absl::StatusOr<ProjectedImage> projected = ReadProjectedImage(light, projection);
    if (!projected.ok()) return projected.status();
    impl_->light_maps.projected.push_back(*std::move(projected));
  }
  const ProjectedImage& projected = impl_->light_maps.projected[known->second];
  if (projected.peak().IsBlack()) return absl::OkStatus();
  ProjectionEmitter delta;
  delta.position = TransformPoint(light.world_from_light, {0, 0, 0}) - render_origin_world_;
  if (!InvertLinearPart(light.world_from_light, &delta.light_from_render)) {
    return ErrorAt(scene_, light.location,
                   "projection light: the transform cannot be inverted; remove the scale of 0");
  }
  delta.cos_end = static_cast<float>(projected.CosCorner());
  double scale = static_cast<double>(light.scale.scale);
  if (light.scale.power_w > 0) {
    scale *= static_cast<double>(light.scale.power_w) / projected.Power();
  }
  delta.emission = Rgb::Gray(static_cast<float>(scale));
  delta.image = known->second;
  return Keep(light, delta, projected.peak());
}

}  // namespace

absl::Status ReadLights(const SceneDescription& scene, Vec3d render_origin_world, bool spectral,
                        FileSource& files, LightTable::Impl* impl) {
  for (const AreaLightDescription& light : scene.area_lights) {
    if (!light.file.empty() || light.scale.power_w > 0) continue;
    const absl::Status usable =
        CheckRadiance(scene, light.location, MaxComponent(light.radiance.rgb) * light.scale.scale);
    if (!usable.ok()) return usable;
  }
  SceneLightReader reader(scene, render_origin_world, files, spectral, impl);
  for (size_t i = 0; i < scene.lights.size(); ++i) {
    const size_t delta_count = impl->deltas.size(), infinite_count = impl->infinites.size();
    const absl::Status status = reader.Read(scene.lights[i]);
    if (!status.ok()) return status;
    const auto description = static_cast<int32_t>(i);
    float largest = 0;
    if (impl->deltas.size() > delta_count) {
      DeltaLight& delta = impl->deltas.back();
      std::visit([&](auto& kind) { kind.description = description; }, delta);
      const auto* distant = std::get_if<DistantEmitter>(&delta);
      if (distant != nullptr) largest = MaxComponent(distant->emission.rgb);
    }
    if (impl->infinites.size() > infinite_count) {
      InfiniteEmitter& infinite = impl->infinites.back();
      infinite.description = description;
      largest = infinite.map ? infinite.scale * static_cast<float>(infinite.map->mean_luminance())
                             : MaxComponent(infinite.radiance.rgb);
    }
    const absl::Status usable = CheckRadiance(scene, scene.lights[i].location, largest);
    if (!usable.ok()) return usable;
  }
  return absl::OkStatus();
}

}  // namespace sheaf::render
