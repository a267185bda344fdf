// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FilmOutputs: the outputs of a frame in addition to its image, and OutputSample, one sample of
// them. Outputs that are not requested cost nothing: no channel, no byte, no instruction.
//
// Every quantity here is a weighted sum along the canonical tree, held as a double-float like
// radiance, so its bits do not depend on how the work was divided.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace sheaf {

// Quantities of the first surface that a camera ray hits.
enum class Aov : uint8_t {
  kPosition,         // P.{X,Y,Z}: scene units.
  kGeometricNormal,  // N.{X,Y,Z}: geometric normal, towards the viewer.
  kShadingNormal,    // Ns.{X,Y,Z}: shading normal, on the same side.
  kUv,               // u, v: surface parameters, with which textures are evaluated.
  kMotion,           // motion.{X,Y}: pixels from shutter opening to closing, y down.
  kCount
};

// The names are part of frame digests and stored jobs: append, never rename.
inline constexpr size_t kAovCount = static_cast<size_t>(Aov::kCount);

// The classifications of surfaces. The renderer's scene_ids.h defines their names.
enum class IdKind : uint8_t {
  kObject,    // A shape of the world, or an instance.
  kMaterial,  // The material's name.
  kAsset,     // The source of an object: its object definition, or the file.
  kCount
};
inline constexpr size_t kIdKindCount = static_cast<size_t>(IdKind::kCount);

// Light groups partition an image: the contribution of each is `NAME.{R,G,B}`, and their sum is the
// image.
inline constexpr size_t kLightGroupsMax = 64;
inline constexpr char kDefaultLightGroup[] = "default";
// Why the text is not a valid name of a light group; empty if it is: 1 to 64 letters, digits, "_"
// and "-", and not a name of other channels.
std::string WhyNotLightGroup(std::string_view name);
// The layers of `light_paths`: the names of light_path_kind.h in their order.
std::vector<std::string> LightPathLayers();

struct FilmOutputs {
  uint32_t aovs = 0;          // One bit per Aov; see Has, Add.
  bool camera_space = false;  // Position and normals in camera space; otherwise world space.
  uint32_t id_numbers = 0;    // One bit per IdKind: the number of the leading id, `objectId`.
  uint32_t cryptomattes = 0;  // One bit per IdKind: CryptoObject00.R etc. (cryptomatte.h).
  std::vector<std::string> light_groups;  // In the order of their names; at most kLightGroupsMax.
  bool light_paths = false;               // light_groups are LightPathLayers().

  bool Has(Aov aov) const { return (aovs >> static_cast<uint32_t>(aov) & 1) != 0; }
  void Add(Aov aov) { aovs |= 1u << static_cast<uint32_t>(aov); }
  void AddLightPaths();  // Replaces any light groups.
  bool HasIdNumber(IdKind kind) const { return (id_numbers >> Index(kind) & 1) != 0; }
  bool HasCryptomatte(IdKind kind) const { return (cryptomattes >> Index(kind) & 1) != 0; }
  bool HasIds(IdKind kind) const { return HasIdNumber(kind) || HasCryptomatte(kind); }
  bool HasIds() const { return id_numbers != 0 || cryptomattes != 0; }
  void AddIdNumber(IdKind kind) { id_numbers |= 1u << Index(kind); }
  void AddCryptomatte(IdKind kind) { cryptomattes |= 1u << Index(kind); }
  static uint32_t Index(IdKind kind) { return static_cast<uint32_t>(kind); }
  bool empty() const { return aovs == 0 && light_groups.empty() && !HasIds(); }
  friend bool operator==(const FilmOutputs&, const FilmOutputs&) = default;
};

// A channel whose pixels are weighted means.
struct MeanChannel {
  std::string name;
  // True: mean over the samples that hit a surface; false: over all samples.
  bool of_surface = false;
  // The first of three that form a direction, scaled to unit length.
  bool starts_direction = false;
  // The first of three that form the red, green and blue of light.
  bool starts_color = false;
};
// In the order of OutputSample::means and of FilmTile's planes.
std::vector<MeanChannel> MeanChannelsOf(const FilmOutputs& outputs);
size_t MeanChannelCount(const FilmOutputs& outputs);

// The renderer's outputs for one sample, in addition to FilmSample.
struct OutputSample {
  explicit OutputSample(const FilmOutputs& outputs) : means(MeanChannelCount(outputs)) {}
  void Clear() {
    means.assign(means.size(), 0);
    ids = {};
  }

  std::vector<float> means;  // Before the filter weight; AOVs are 0 without a surface.
  std::array<uint32_t, kIdKindCount> ids{};  // The surface's; 0 if there is none or not requested.
};

// "object", "material", "asset".
const char* IdKindName(IdKind kind);
// Adds the cryptomattes of a list such as "object,asset". Errors: kInvalidArgument.
absl::Status AddCryptomattes(std::string_view names, FilmOutputs* outputs);
// "objectId": the channel of an id's number.
std::string IdNumberChannel(IdKind kind);

// "position", "uv", ...: the names used by --aov.
const char* AovName(Aov aov);
// Adds the outputs of a list such as "position,uv,object-id". Also accepts albedo, normal and
// depth, which every image has.
// Errors: kInvalidArgument, listing the valid names.
absl::Status AddAovs(std::string_view names, FilmOutputs* outputs);

// One line of text with all outputs, empty for none; and its parser.
// Errors: kInvalidArgument if FormatOutputs does not produce the line.
std::string FormatOutputs(const FilmOutputs& outputs);
absl::StatusOr<FilmOutputs> ParseOutputs(std::string_view text);

}  // namespace sheaf
