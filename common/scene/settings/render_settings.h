// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RenderSettings: the choices of the submitter beyond the scene file; and FrameSettings, the same
// after the scene's own values have filled the gaps. Together with the scene digest and the numeric
// profile they determine every sample (frame digest).
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "common/film/film_outputs.h"
#include "common/film/image_color.h"
#include "common/film/pixel_lattice.h"
#include "common/film/task_kind.h"
#include "common/film/tile_geometry.h"
#include "common/scene/scene_description.h"
#include "common/scene/settings/techniques.h"

namespace sheaf {

// Limits of one frame.
inline constexpr int64_t kFramePixelsMax = int64_t{1} << 40;
inline constexpr uint64_t kSamplesPerPixelMax = uint64_t{1} << 48;
inline constexpr int32_t kMaxDepthMax = 1 << 20;
inline constexpr int32_t kSimilarityAfterMax = 1 << 20;
inline constexpr int32_t kLightSamplesMax = 16;

// The color representation along a path. kAuto: wavelengths if the scene needs them (dispersion,
// colors outside of sRGB), else RGB.
enum class ColorTransport : uint8_t { kAuto = 0, kRgb = 1, kSpectral = 2 };
// "auto", "rgb", "spectral".
const char* ColorTransportName(ColorTransport color);

struct RenderSettings {
  std::optional<uint64_t> samples;  // Per pixel; otherwise the scene's.
  std::optional<int32_t> max_depth;
  std::optional<uint64_t> seed;
  std::optional<PixelRect> crop;  // Within the frame; otherwise the scene's.
  ColorTransport color = ColorTransport::kAuto;
  std::optional<Primaries> primaries;  // For the image; otherwise the scene's.
  FilmOutputs outputs;                 // In addition to those that the scene's film requests.
  bool light_groups = false;           // One output for each light group of the scene.
  bool light_paths = false;            // One output for each LightPathKind. Excludes light_groups.
  // Rough surfaces scatter light once and lose the energy of multiple scattering, as in pbrt-v4, so
  // that images can be compared with it. Otherwise they keep that energy.
  bool single_scattering = false;
  // A pixel's samples come from one sequence instead of kReplicateCount independent ones: less
  // noise where a pixel is smooth, but the standard error is only an upper estimate.
  bool one_sequence = false;
  // Biased, unless 0: after this many scatterings in media, a path continues in equivalent media
  // that scatter isotropically and less often (similarity relation). See docs/adr/0031.
  int32_t similarity_after = 0;
  // The most light samples at a vertex, from 1 to kLightSamplesMax: with more than 1, the hierarchy
  // of lights is split where its estimates are uncertain. See docs/adr/0070.
  int32_t light_samples = 1;
  std::optional<float> max_component_value;  // Otherwise the scene's; 0: none.
  // With eye_distance > 0, a stereo frame: FrameSettings.
  float eye_distance = 0, eye_convergence = 0;
  std::optional<TechniqueSet> techniques;  // Otherwise those of the scene's integrator.
  // Measure which techniques pay (MeasureTechniques), instead of `techniques`; for the caller of
  // ResolveSettings to do.
  bool measure_techniques = false;
  bool force_generic_variant = false;  // Changes no pixel, so it is not part of the digest.
};

struct FrameSettings {
  int32_t width_px = 0, height_px = 0;
  PixelRect window;  // Pixels to render.
  uint64_t samples = 16;
  int32_t max_depth = 5;
  uint64_t seed = 0;
  ColorTransport color = ColorTransport::kAuto;
  bool single_scattering = false;
  bool one_sequence = false;
  int32_t similarity_after = 0;
  // 0: one at each vertex.
  // Else from 2 to kLightSamplesMax, as RenderSettings::light_samples.
  int32_t light_samples = 0;
  TechniqueSet techniques = TechniqueSet::kCamera;
  // In a stereo frame: the distance of its eyes, above 0, and how far away both see a point in the
  // middle of their images, 0 for infinity; in units of the camera's space (stereo.h). The frame is
  // then the film of the left eye, and right of it that of the right eye.
  float eye_distance = 0, eye_convergence = 0;
  bool IsStereo() const { return eye_distance > 0; }
  bool force_generic_variant = false;
  // The pixels of the window that are rendered; the others stay empty.
  PixelLattice lattice;
  FilmOutputs outputs;
  // From the scene's film: the camera's sensor, if not the CIE observer; and the maximum response
  // to one sample, which biases the image; 0 is no maximum.
  std::string sensor;
  float max_component_value = 0;
  // Properties of the delivered image; parts do not depend on them.
  Primaries primaries = Primaries::kSrgb;
  float white_balance_k = 0;  // See ImageColorOf.
  friend bool operator==(const FrameSettings&, const FrameSettings&) = default;
};

// Whether FrameSettings::light_samples may have the value.
constexpr bool IsLightSamples(int32_t count) {
  return count == 0 || (count >= 2 && count <= kLightSamplesMax);
}

// The outputs of the frame's light passes: settings.outputs, and the estimate of bias where light
// paths are merged (common/film/task_kind.h).
FilmOutputs LightOutputsOf(const FrameSettings& settings);
// The outputs of the parts of a kind of task.
FilmOutputs OutputsOf(TaskKind kind, const FrameSettings& settings);

// Errors: kInvalidArgument for an empty crop, 0 samples, a depth, similarity_after or
// light_samples out of range, a frame beyond limits, outputs that the scene's camera does not have,
// more than kLightGroupsMax light groups.
absl::StatusOr<FrameSettings> ResolveSettings(const SceneDescription& scene,
                                              const RenderSettings& settings);

// Checks settings that another program sent. Errors: kInvalidArgument for a value out of range.
absl::Status CheckSettings(const FrameSettings& settings);

// A line for users who compare the image with pbrt-v4's; empty if no difference is expected.
std::string ComparisonNote(const SceneDescription& scene, const FrameSettings& settings);

// "x86-64-v3 sheaf-0.1.0 gcc-12 embree-3.13.5 build-0123456789ab": instruction set and build, which
// ends in a digest of all that decides the bits of an image (cmake/BuildId.cmake). A job pins one.
std::string NumericProfile();

// The text whose SHA-256 is the frame digest: one "name value" per line, in a fixed order.
// Printable; delivered images carry it in their metadata.
std::string FrameDigestText(const std::string& scene_digest, const FrameSettings& settings,
                            const std::string& numeric_profile);

// Hex SHA-256 over scene digest, settings and profile. Excludes force_generic_variant, and the
// number of samples, which changes none of the samples: the parts of a frame are reused when more
// samples are requested.
std::string FrameDigest(const std::string& scene_digest, const FrameSettings& settings,
                        const std::string& numeric_profile);

}  // namespace sheaf
