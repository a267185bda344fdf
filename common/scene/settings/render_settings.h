// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RenderSettings: what the person who submits decides beyond the scene file, and FrameSettings, the
// same after the scene's own values have filled the gaps. Together with the scene digest and the
// numeric profile they determine every sample (frame digest).
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "common/film/film_outputs.h"
#include "common/film/picture_color.h"
#include "common/film/pixel_lattice.h"
#include "common/film/tile_geometry.h"
#include "common/scene/scene_description.h"

namespace sheaf {

// Limits of what one frame may ask for.
inline constexpr int64_t kFramePixelsMax = int64_t{1} << 40;
inline constexpr uint64_t kSamplesPerPixelMax = uint64_t{1} << 48;
inline constexpr int32_t kMaxDepthMax = 1 << 20;
inline constexpr int32_t kSimilarityAfterMax = 1 << 20;

// What a path carries. kAuto: wavelengths where the scene calls for them (dispersion,
// colours outside of sRGB), else RGB.
enum class ColorTransport : uint8_t { kAuto = 0, kRgb = 1, kSpectral = 2 };
// "auto", "rgb", "spectral".
const char* ColorTransportName(ColorTransport color);

struct RenderSettings {
  std::optional<uint64_t> samples;  // Per pixel; otherwise the scene's.
  std::optional<int32_t> max_depth;
  std::optional<uint64_t> seed;
  std::optional<PixelRect> crop;  // Within the frame; otherwise the scene's.
  ColorTransport color = ColorTransport::kAuto;
  std::optional<Primaries> primaries;  // Of the picture; otherwise the scene's.
  FilmOutputs outputs;                 // Besides those that the scene's film asks for.
  bool light_groups = false;           // One output for each light group of the scene.
  bool light_paths = false;            // One for each LightPathKind. Not both.
  // Rough surfaces scatter light once and lose what is scattered again, as in pbrt-v4, whose
  // pictures can then be matched. Otherwise they keep that energy.
  bool single_scattering = false;
  // A pixel's samples come from one sequence, not from kReplicateCount independent ones: less noise
  // where a pixel is smooth, and of the standard error no more than an upper estimate.
  bool one_sequence = false;
  // Biased, unless 0: after so many scatterings in media a path goes on in media that scatter
  // evenly and less often, by similarity. See docs/adr/0031.
  int32_t similarity_after = 0;
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
  bool force_generic_variant = false;
  // The pixels of the window that are rendered; others stay empty.
  PixelLattice lattice;
  FilmOutputs outputs;
  // From the scene's film: the camera's sensor that sees the light, where it is not the CIE
  // observer, and, biased, the most that it responds to a sample, unless 0.
  std::string sensor;
  float max_component_value = 0;
  // Of the delivered picture; parts do not depend on them.
  Primaries primaries = Primaries::kSrgb;
  float white_balance_k = 0;  // As PictureColorOf.
};

// Errors: kInvalidArgument for an empty crop, 0 samples, a depth or similarity_after outside of its
// range, a frame beyond limits, outputs that the scene's camera does not have, more than
// kLightGroupsMax light groups.
absl::StatusOr<FrameSettings> ResolveSettings(const SceneDescription& scene,
                                              const RenderSettings& settings);

// A line for whoever compares the picture with pbrt-v4's; empty where there is nothing to know.
std::string ComparisonNote(const SceneDescription& scene, const FrameSettings& settings);

// "x86-64-v3 sheaf-0.1.0 gcc-12 embree-3.13.5": build and instruction set. A job pins one.
std::string NumericProfile();

// The text whose SHA-256 is the frame digest: one "name value" a line, in a fixed order. Printable;
// delivered pictures carry it in their metadata.
std::string FrameDigestText(const std::string& scene_digest, const FrameSettings& settings,
                            const std::string& numeric_profile);

// Hex SHA-256 over scene digest, settings and profile. Without force_generic_variant, and without
// the number of samples, which changes none of them: a frame's parts serve whoever asks for more.
std::string FrameDigest(const std::string& scene_digest, const FrameSettings& settings,
                        const std::string& numeric_profile);

}  // namespace sheaf
