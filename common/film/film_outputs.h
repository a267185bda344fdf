// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FilmOutputs: what a frame delivers besides the picture, and OutputSample, one sample of it. Who
// asks for nothing has nothing: no channel, no byte, no instruction.
//
// Every quantity here is a weighted sum along the canonical tree, held as a double-float like
// radiance, so it is the same to the bit however the work was cut.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace sheaf {

// Quantities of the first surface that a camera ray meets.
enum class Aov : uint8_t {
  kPosition,         // P.{X,Y,Z}: scene units.
  kGeometricNormal,  // N.{X,Y,Z}: of the true surface, towards the viewer.
  kShadingNormal,    // Ns.{X,Y,Z}: of shading, on the same side.
  kUv,               // u, v: surface parameters, those that textures are looked up by.
  kMotion,           // motion.{X,Y}: pixels from shutter opening to closing, y down.
  kCount
};

// The names are part of frame digests and stored jobs: append, never rename.
inline constexpr size_t kAovCount = static_cast<size_t>(Aov::kCount);

// What a scene's surfaces are counted as. scene_ids.h of the renderer says how they are named.
enum class IdKind : uint8_t {
  kObject,    // A shape of the world, or an instance.
  kMaterial,  // As the surface names it.
  kAsset,     // What an object was made from: its object definition, or the file.
  kCount
};
inline constexpr size_t kIdKindCount = static_cast<size_t>(IdKind::kCount);

// Light groups share a picture: what each contributes to it, `NAME.{R,G,B}`. Their sum is the
// picture.
inline constexpr size_t kLightGroupsMax = 64;
inline constexpr char kDefaultLightGroup[] = "default";
// Why the text cannot name a light group; empty where it can: 1 to 64 letters, digits, "_" and "-",
// not a name that other channels have.
std::string WhyNotLightGroup(std::string_view name);
// The layers of `light_paths`: the names of light_path_kind.h in their order.
std::vector<std::string> LightPathLayers();

struct FilmOutputs {
  uint32_t aovs = 0;          // One bit each: Has, Add.
  bool camera_space = false;  // Position and normals in camera space; otherwise world space.
  uint32_t id_numbers = 0;    // One bit for each IdKind: the leading id's number, `objectId`.
  uint32_t cryptomattes = 0;  // One bit for each IdKind: CryptoObject00.R and on (cryptomatte.h).
  std::vector<std::string> light_groups;  // In the order of their names; at most kLightGroupsMax.
  bool light_paths = false;               // light_groups are LightPathLayers().

  bool Has(Aov aov) const { return (aovs >> static_cast<uint32_t>(aov) & 1) != 0; }
  void Add(Aov aov) { aovs |= 1u << static_cast<uint32_t>(aov); }
  void AddLightPaths();  // In place of what light groups there are.
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
  // The mean is over the samples that met a surface; otherwise over all.
  bool of_surface = false;
  // The first of three that are one direction, scaled to unit length.
  bool starts_direction = false;
  // The first of three that are light's red, green and blue.
  bool starts_color = false;
};
// In the order of OutputSample::means and of FilmTile's planes.
std::vector<MeanChannel> MeanChannelsOf(const FilmOutputs& outputs);
size_t MeanChannelCount(const FilmOutputs& outputs);

// What the renderer hands over for one sample beside FilmSample.
struct OutputSample {
  explicit OutputSample(const FilmOutputs& outputs) : means(MeanChannelCount(outputs)) {}
  void Clear() {
    means.assign(means.size(), 0);
    ids = {};
  }

  std::vector<float> means;  // Before the filter weight; AOVs are 0 where there was no surface.
  std::array<uint32_t, kIdKindCount> ids{};  // Of the surface; 0 where there was none, or unasked.
};

// "object", "material", "asset".
const char* IdKindName(IdKind kind);
// Adds the cryptomattes that a list such as "object,asset" names. Errors: kInvalidArgument.
absl::Status AddCryptomattes(std::string_view names, FilmOutputs* outputs);
// "objectId": the channel of an id's number.
std::string IdNumberChannel(IdKind kind);

// "position", "uv", ...: as asked for by --aov.
const char* AovName(Aov aov);
// Adds what a list such as "position,uv,object-id" names. Also takes albedo, normal and depth,
// which every picture has. Errors: kInvalidArgument, with the names there are.
absl::Status AddAovs(std::string_view names, FilmOutputs* outputs);

// One line of text that tells all, empty for nothing; and back. Errors: kInvalidArgument where it
// is not a line that FormatOutputs writes.
std::string FormatOutputs(const FilmOutputs& outputs);
absl::StatusOr<FilmOutputs> ParseOutputs(std::string_view text);

}  // namespace sheaf
