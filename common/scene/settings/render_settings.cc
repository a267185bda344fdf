// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/settings/render_settings.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <type_traits>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/base/digest.h"
#include "common/film/denoised_output.h"
#include "common/scene/settings/chain_settings.h"
#include "common/scene/settings/frame_settings_fields.h"
#include "common/scene/settings/path_shares.h"
#include "common/scene/settings/ray_visibility_check.h"
#include "common/scene/settings/stereo.h"
#include "common/scene/spectrum/primaries.h"
#include "common/scene/spectrum/sensor.h"
#include "sheaf_build_id.h"

#ifndef SHEAF_VERSION
#error "common/scene/CMakeLists.txt defines SHEAF_VERSION, SHEAF_MARCH and SHEAF_EMBREE_VERSION"
#endif

namespace sheaf {
namespace {

std::string RectText(const PixelRect& rect) {
  return absl::StrCat("[", rect.x0, ", ", rect.x1, ") x [", rect.y0, ", ", rect.y1, ")");
}

// First pixel whose left edge is at or right of the fraction: pbrt-v4's rule, so that abutting
// crops neither overlap nor leave a gap.
int32_t CropPixel(double fraction, int32_t size_px) {
  return static_cast<int32_t>(std::ceil(size_px * std::clamp(fraction, 0.0, 1.0)));
}

PixelRect SceneWindow(const FilmDescription& film) {
  if (film.has_pixel_bounds) {
    const auto& b = film.pixel_bounds;
    return {std::clamp(b[0], 0, film.width_px), std::clamp(b[2], 0, film.height_px),
            std::clamp(b[1], 0, film.width_px), std::clamp(b[3], 0, film.height_px)};
  }
  const auto& c = film.crop_window;
  return {CropPixel(c[0], film.width_px), CropPixel(c[2], film.height_px),
          CropPixel(c[1], film.width_px), CropPixel(c[3], film.height_px)};
}

absl::Status CheckFrame(const SceneDescription& scene) {
  const FilmDescription& film = scene.film;
  if (film.width_px < 1 || film.height_px < 1) {
    return absl::InvalidArgumentError(absl::StrCat(
        FormatLocation(scene, film.location), ": the frame of ", film.width_px, " x ",
        film.height_px, " pixels is empty; xresolution and yresolution must be at least 1"));
  }
  if (int64_t{film.width_px} * film.height_px > kFramePixelsMax) {
    return absl::InvalidArgumentError(
        absl::StrCat(FormatLocation(scene, film.location), ": the frame of ", film.width_px, " x ",
                     film.height_px, " pixels exceeds the limit of ", kFramePixelsMax, " pixels"));
  }
  return absl::OkStatus();
}

absl::Status CheckCounts(const FrameSettings& settings) {
  if (settings.samples == 0) {
    return absl::InvalidArgumentError("0 samples per pixel give no image; request at least 1");
  }
  if (settings.samples > kSamplesPerPixelMax) {
    return absl::InvalidArgumentError(absl::StrCat(
        settings.samples, " samples per pixel exceed the limit of ", kSamplesPerPixelMax));
  }
  if (settings.max_depth < 0 || settings.max_depth > kMaxDepthMax) {
    return absl::InvalidArgumentError(
        absl::StrCat("maximum depth ", settings.max_depth, " is outside [0, ", kMaxDepthMax, "]"));
  }
  if (settings.similarity_after < 0 || settings.similarity_after > kSimilarityAfterMax) {
    return absl::InvalidArgumentError(absl::StrCat("similarity after ", settings.similarity_after,
                                                   " scatterings is outside [0, ",
                                                   kSimilarityAfterMax, "]; 0 turns it off"));
  }
  return absl::OkStatus();
}

absl::Status CheckLightSamples(int32_t count) {
  if (count >= 1 && count <= kLightSamplesMax) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(count, " light samples at a vertex are outside [1, ", kLightSamplesMax, "]"));
}

std::vector<std::string> LightGroupsOf(const SceneDescription& scene) {
  std::set<std::string> groups;
  for (const AreaLightDescription& light : scene.area_lights) groups.insert(light.group);
  for (const LightDescription& light : scene.lights) groups.insert(light.group);
  for (const MediumDescription& medium : scene.media) {
    if (medium.emits) groups.insert(kDefaultLightGroup);
  }
  return {groups.begin(), groups.end()};
}

absl::Status CheckOutputs(const SceneDescription& scene, const FilmOutputs& outputs) {
  if (outputs.Has(Aov::kMotion) && scene.camera.IsSpherical()) {
    return absl::InvalidArgumentError(
        absl::StrCat(FormatLocation(scene, scene.camera.location),
                     ": a spherical camera has no motion vectors; remove the output \"",
                     AovName(Aov::kMotion), "\""));
  }
  if (outputs.Has(Aov::kMotion) && scene.camera.IsRealistic()) {
    return absl::InvalidArgumentError(
        absl::StrCat(FormatLocation(scene, scene.camera.location),
                     ": a realistic camera has no motion vectors; remove the output \"",
                     AovName(Aov::kMotion), "\""));
  }
  if (outputs.light_groups.size() > kLightGroupsMax) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the scene's lights have ", outputs.light_groups.size(), " groups, more than the limit of ",
        kLightGroupsMax, "; give them fewer names"));
  }
  return absl::OkStatus();
}

bool IsRough(const FloatInput& roughness) {
  return roughness.texture != kNone || roughness.value > 0;
}

// Whether the material keeps light that pbrt-v4 loses: multiple scattering by microfacets or a
// coat.
bool ScattersLostLight(const MaterialDescription& description) {
  return std::visit(
      [](const auto& material) {
        using Material = std::decay_t<decltype(material)>;
        if constexpr (std::is_base_of_v<ClearCoat, Material>) {
          return true;
        } else if constexpr (!DescribedMaterial<Material> && requires { material.roughness.u; }) {
          return IsRough(material.roughness.u) || IsRough(material.roughness.v);
        } else {
          return false;
        }
      },
      description.material);
}

// Full precision, as digests need it.
std::string DigestValue(const SettingField&, float value) { return absl::StrFormat("%.9g", value); }
template <typename T>
std::string DigestValue(const SettingField& field, const T& value) {
  return SettingText(field, value);
}

}  // namespace

std::string SettingText(const SettingField& field, bool value) {
  return value ? field.digest.on : field.digest.off;
}
std::string SettingText(const SettingField&, int32_t value) { return absl::StrCat(value); }
std::string SettingText(const SettingField&, uint64_t value) { return absl::StrCat(value); }
std::string SettingText(const SettingField&, float value) { return absl::StrCat(value); }
std::string SettingText(const SettingField&, const std::string& value) { return value; }
std::string SettingText(const SettingField&, ColorTransport value) {
  return ColorTransportName(value);
}
std::string SettingText(const SettingField&, TechniqueSet value) { return value.Name(); }
std::string SettingText(const SettingField&, Primaries value) { return PrimariesName(value); }
std::string SettingText(const SettingField&, const FilmOutputs& value) {
  return FormatOutputs(value);
}
std::string SettingText(const SettingField&, const PixelLattice& value) {
  return absl::StrCat(value.stride_px);
}
std::string SettingText(const SettingField&, const PixelRect& value) { return RectText(value); }

const char* ColorTransportName(ColorTransport color) {
  switch (color) {
    case ColorTransport::kAuto:
      return "auto";
    case ColorTransport::kRgb:
      return "rgb";
    case ColorTransport::kSpectral:
      return "spectral";
  }
  return "unknown";
}

absl::StatusOr<FrameSettings> ResolveSettings(const SceneDescription& scene,
                                              const RenderSettings& settings) {
  if (absl::Status status = CheckFrame(scene); !status.ok()) return status;
  if (absl::Status status = CheckLightSamples(settings.light_samples); !status.ok()) return status;
  FrameSettings resolved;
  resolved.width_px = scene.film.width_px;
  resolved.height_px = scene.film.height_px;
  resolved.window = SceneWindow(scene.film);
  if (resolved.window.IsEmpty()) {
    return absl::InvalidArgumentError(absl::StrCat(FormatLocation(scene, scene.film.location),
                                                   ": the film's crop ", RectText(resolved.window),
                                                   " holds no pixel of the frame"));
  }
  if (settings.crop.has_value()) {
    const PixelRect window = Intersect(*settings.crop, resolved.window);
    if (window.IsEmpty()) {
      return absl::InvalidArgumentError(absl::StrCat("the crop ", RectText(*settings.crop),
                                                     " holds no pixel of the scene's window ",
                                                     RectText(resolved.window)));
    }
    resolved.window = window;
  }
  resolved.samples = settings.samples.value_or(
      static_cast<uint64_t>(std::max(0, scene.sampling.samples_per_pixel)));
  resolved.max_depth = settings.max_depth.value_or(scene.sampling.max_depth);
  resolved.seed = settings.seed.value_or(scene.sampling.seed);
  resolved.color = settings.color;
  resolved.single_scattering = settings.single_scattering;
  resolved.one_sequence = settings.one_sequence;
  resolved.similarity_after = settings.similarity_after;
  resolved.light_samples = settings.light_samples == 1 ? 0 : settings.light_samples;
  resolved.techniques =
      settings.techniques.value_or(TechniquesOfIntegrator(scene.sampling.integrator));
  if (!settings.techniques && FirstInvisible(scene) != nullptr) {
    resolved.techniques = KnowingRayKinds(resolved.techniques);
  }
  resolved.force_generic_variant = settings.force_generic_variant;
  resolved.primaries = settings.primaries.value_or(scene.film.primaries);
  resolved.white_balance_k = scene.film.white_balance_k;
  resolved.sensor = scene.film.sensor;
  resolved.max_component_value =
      settings.max_component_value.value_or(scene.film.max_component_value);
  resolved.outputs = settings.outputs;
  resolved.outputs.aovs |= scene.film.outputs.aovs;
  resolved.outputs.camera_space = scene.film.outputs.camera_space;
  if (settings.light_groups && settings.light_paths) {
    return absl::InvalidArgumentError(
        "light is separated either by groups of lights or by kinds of paths; request one of them");
  }
  if (settings.light_groups) resolved.outputs.light_groups = LightGroupsOf(scene);
  if (settings.light_paths) resolved.outputs.AddLightPaths();
  if (absl::Status status = CheckCounts(resolved); !status.ok()) return status;
  if (resolved.white_balance_k != 0 && !(resolved.white_balance_k >= kWhiteBalanceMinK &&
                                         resolved.white_balance_k <= kWhiteBalanceMaxK)) {
    return absl::InvalidArgumentError(
        absl::StrCat(FormatLocation(scene, scene.film.location), ": a white balance of ",
                     resolved.white_balance_k, " K is outside [", kWhiteBalanceMinK, ", ",
                     kWhiteBalanceMaxK, "]"));
  }
  if (absl::Status status = CheckOutputs(scene, resolved.outputs); !status.ok()) return status;
  if (HasDenoised(resolved.outputs) && resolved.one_sequence) {
    return absl::InvalidArgumentError(
        "--denoise needs independent replicates, which --one-sequence does not have; remove one of "
        "them");
  }
  if (settings.eye_distance > 0) {
    if (absl::Status status = MakeStereo(scene, settings, &resolved); !status.ok()) return status;
  }
  if (absl::Status status = CheckSharing(resolved); !status.ok()) return status;
  if (absl::Status status = CheckRayVisibility(scene, resolved); !status.ok()) return status;
  if (absl::Status status = CheckChains(resolved); !status.ok()) return status;
  return resolved;
}

absl::Status CheckSettings(const FrameSettings& settings) {
  if (settings.similarity_after < 0 || settings.similarity_after > kSimilarityAfterMax) {
    return absl::InvalidArgumentError(absl::StrCat("similarity after ", settings.similarity_after,
                                                   " scatterings is out of range"));
  }
  if (!IsLightSamples(settings.light_samples)) {
    return absl::InvalidArgumentError(
        absl::StrCat(settings.light_samples, " light samples at a vertex are out of range"));
  }
  if (settings.white_balance_k != 0 && !(settings.white_balance_k >= kWhiteBalanceMinK &&
                                         settings.white_balance_k <= kWhiteBalanceMaxK)) {
    return absl::InvalidArgumentError(
        absl::StrCat("a white balance of ", settings.white_balance_k, " K is out of range"));
  }
  if (!AreEyeDistances(settings.eye_distance, settings.eye_convergence)) {
    return absl::InvalidArgumentError(absl::StrCat("eyes cannot be ", settings.eye_distance,
                                                   " apart and converge at ",
                                                   settings.eye_convergence));
  }
  if (!settings.sensor.empty() && !IsSensor(settings.sensor)) {
    return absl::InvalidArgumentError("the camera's sensor is unknown here");
  }
  if (!(settings.max_component_value >= 0 && std::isfinite(settings.max_component_value))) {
    return absl::InvalidArgumentError(
        absl::StrCat("samples cannot be clamped to ", settings.max_component_value));
  }
  return absl::OkStatus();
}

FilmOutputs LightOutputsOf(const FrameSettings& settings) {
  FilmOutputs outputs = settings.outputs;
  if (MergesLightPaths(settings.techniques)) AddMergeBias(&outputs);
  return outputs;
}

FilmOutputs OutputsOf(TaskKind kind, const FrameSettings& settings) {
  return kind == TaskKind::kLight ? LightOutputsOf(settings) : settings.outputs;
}

std::string ComparisonNote(const SceneDescription& scene, const FrameSettings& settings) {
  if (settings.single_scattering ||
      std::none_of(scene.materials.begin(), scene.materials.end(), ScattersLostLight)) {
    return "";
  }
  return "coated and rough materials keep light that pbrt-v4 loses, because they scatter it again: "
         "rooms full of them are about 5 to 10 % brighter; --single-scattering --color spectral "
         "agrees with pbrt-v4";
}

std::string NumericProfile() {
#if defined(__clang__)
  const std::string compiler = absl::StrCat("clang-", __clang_major__);
#else
  const std::string compiler = absl::StrCat("gcc-", __GNUC__);
#endif
  return absl::StrCat(SHEAF_MARCH, " sheaf-", SHEAF_VERSION, " ", compiler, " embree-",
                      SHEAF_EMBREE_VERSION, " build-", SHEAF_BUILD_ID);
}

std::string FrameDigestText(const std::string& scene_digest, const FrameSettings& settings,
                            const std::string& numeric_profile) {
  const PixelRect& w = settings.window;
  std::map<int, std::string> lines;  // By place.
  VisitFrameSettings(settings, [&lines](const SettingField& field, const auto& value) {
    const DigestLine& line = field.digest;
    // Frames keep the digests that they had before a setting existed.
    if (line.place == 0 || (!line.always && IsDefaultSetting(value))) return;
    lines[line.place] = absl::StrCat(line.name, " ", DigestValue(field, value), "\n");
  });
  std::string text =
      absl::StrCat("sheaf-frame 3\nscene ", scene_digest, "\nsize_px ", settings.width_px, " ",
                   settings.height_px, "\nwindow_px ", w.x0, " ", w.y0, " ", w.x1, " ", w.y1, "\n");
  for (const auto& [place, line] : lines) text += line;
  return absl::StrCat(text, "profile ", numeric_profile, "\n");
}

std::string FrameDigest(const std::string& scene_digest, const FrameSettings& settings,
                        const std::string& numeric_profile) {
  return Sha256Hex(FrameDigestText(scene_digest, settings, numeric_profile));
}

}  // namespace sheaf
