// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The parameters of textures that are computed from the place.
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "common/scene/node_parameters.h"
#include "common/scene/pbrt/statements/color_parameters.h"
#include "common/scene/pbrt/statements/texture_table.h"

namespace sheaf {
namespace {

int32_t GetOctaves(ParameterList& parameters) {
  const int32_t octaves = parameters.GetInteger("octaves", 8);
  if (octaves >= 1 && octaves <= NoiseTexture::kOctavesMax) return octaves;
  parameters.ErrorAt(
      *parameters.Find("octaves"),
      absl::StrCat("is ", octaves, "; it must be from 1 to ", NoiseTexture::kOctavesMax));
  return 1;
}

// The inputs of two names, the first of which is `first` by default, the second the opposite.
template <typename Texture>
void GetPair(TextureTable& table, ParameterList& parameters, bool is_color,
             const std::array<const char*, 2>& names, float first, Texture* texture) {
  for (size_t i = 0; i < 2; ++i) {
    const float fallback = i == 0 ? first : 1 - first;
    if (is_color) {
      texture->color[i] = table.GetColorInput(parameters, names[i], ColorRole::kReflectance,
                                              RgbColor(Rgb::Gray(fallback)));
    } else {
      texture->value[i] = table.GetFloatInput(parameters, names[i], fallback);
    }
  }
}

// A choice by its word, any other parameter by its number.
float GetNumber(ParameterList& parameters, const NodeParameter& parameter) {
  const std::string name(parameter.name);
  if (parameter.words.empty()) {
    const float value = parameters.GetFloat(name, parameter.fallback);
    if (value >= parameter.least && value <= parameter.greatest) return value;
    parameters.ErrorAt(*parameters.Find(name),
                       absl::StrCat("is ", value, "; it must be from ", parameter.least, " to ",
                                    parameter.greatest));
    return parameter.fallback;
  }
  const std::vector<std::string> words =
      absl::StrSplit(absl::string_view(parameter.words.data(), parameter.words.size()), ' ');
  const std::string word =
      parameters.GetString(name, words[static_cast<size_t>(parameter.fallback)]);
  const auto found = std::find(words.begin(), words.end(), word);
  if (found != words.end()) return static_cast<float>(found - words.begin());
  parameters.ErrorAt(*parameters.Find(name), absl::StrCat("is \"", word, "\"; it must be one of ",
                                                          absl::StrJoin(words, ", ")));
  return parameter.fallback;
}

// The affine map of (u, v, 0) to the place of a node: three rows of four numbers.
Matrix4 GetUvPlacement(ParameterList& parameters) {
  constexpr size_t kNumbers = 12;
  Matrix4 placement;
  const std::vector<float> numbers = parameters.GetFloats("placement");
  if (numbers.size() == kNumbers) {
    for (size_t i = 0; i < kNumbers; ++i) placement.m[i / 4][i % 4] = numbers[i];
  } else if (const Parameter* given = parameters.Find("placement"); given != nullptr) {
    parameters.ErrorAt(*given, "must be 12 floats, three rows of an affine map");
  }
  return placement;
}

}  // namespace

NodeTexture TextureTable::MakeNode(ParameterList& parameters, const Matrix4& world_from_texture) {
  NodeTexture node;
  const std::string from = parameters.GetString("from", "position");
  node.from_uv = from == "uv";
  node.texture_from_place =
      node.from_uv ? GetUvPlacement(parameters) : TextureFromWorld(parameters, world_from_texture);
  if (from != "uv" && from != "position") {
    parameters.ErrorAt(*parameters.Find("from"),
                       absl::StrCat("is \"", from, "\"; it must be position or uv"));
  }
  const std::string name = parameters.GetString("node", "noise");
  std::vector<std::string> names;
  for (const NodeParameters& known : kNodeParameters) {
    names.emplace_back(known.name);
    if (known.name != name) continue;
    node.kind = known.kind;
    for (size_t i = 0; i < known.parameters.size(); ++i) {
      if (known.parameters[i].name.empty()) break;
      node.numbers[i] = GetNumber(parameters, known.parameters[i]);
    }
    return node;
  }
  parameters.ErrorAt(*parameters.Find("node"), absl::StrCat("is \"", name, "\"; it must be one of ",
                                                            absl::StrJoin(names, ", ")));
  parameters.IgnoreAll();
  return node;
}

RampTexture TextureTable::MakeRamp(ParameterList& parameters, bool is_color) {
  RampTexture ramp;
  ramp.input = GetFloatInput(parameters, "input", 0);
  const std::string kind = parameters.GetString("interpolation", "linear");
  ramp.is_stepped = kind == "constant";
  if (kind != "linear" && kind != "constant") {
    parameters.ErrorAt(*parameters.Find("interpolation"),
                       absl::StrCat("is \"", kind, "\"; it must be linear or constant"));
  }
  const std::vector<float> positions = parameters.GetFloats("positions");
  const std::string name = is_color ? "colors" : "values";
  const std::vector<float> values = parameters.GetFloats(name);
  const size_t channels = is_color ? 3 : 1;
  if (positions.empty() || positions.size() > RampTexture::kStopsMax ||
      values.size() != channels * positions.size()) {
    parameters.Error(absl::StrCat(parameters.owner(), " needs \"float positions\", 1 to ",
                                  RampTexture::kStopsMax, " numbers, and \"float ", name, "\", ",
                                  channels, " for each"));
  } else if (!std::is_sorted(positions.begin(), positions.end())) {
    parameters.ErrorAt(*parameters.Find("positions"), "must not decrease");
  } else {
    for (size_t i = 0; i < positions.size(); ++i) {
      RampTexture::Stop stop;
      stop.position = positions[i];
      if (is_color) {
        stop.color = {values[3 * i], values[3 * i + 1], values[3 * i + 2]};
      } else {
        stop.value = values[i];
      }
      ramp.stops.push_back(stop);
    }
  }
  if (ramp.stops.empty()) ramp.stops.emplace_back();
  return ramp;
}

NoiseTexture TextureTable::MakeNoise(ParameterList& parameters, NoiseTexture::Kind kind,
                                     const Matrix4& world_from_texture) {
  NoiseTexture noise;
  noise.kind = kind;
  noise.texture_from_world = TextureFromWorld(parameters, world_from_texture);
  if (kind == NoiseTexture::Kind::kWindy) return noise;
  noise.octaves = GetOctaves(parameters);
  noise.roughness = parameters.GetFloat("roughness", noise.roughness);
  return noise;
}

MarbleTexture TextureTable::MakeMarble(ParameterList& parameters,
                                       const Matrix4& world_from_texture) {
  MarbleTexture marble;
  marble.texture_from_world = TextureFromWorld(parameters, world_from_texture);
  marble.octaves = GetOctaves(parameters);
  marble.roughness = parameters.GetFloat("roughness", marble.roughness);
  marble.scale = parameters.GetFloat("scale", marble.scale);
  marble.variation = parameters.GetFloat("variation", marble.variation);
  return marble;
}

DotsTexture TextureTable::MakeDots(ParameterList& parameters, bool is_color,
                                   const Matrix4& world_from_texture) {
  DotsTexture dots;
  dots.mapping = GetUvMapping(parameters, world_from_texture);
  GetPair(*this, parameters, is_color, {"inside", "outside"}, 1, &dots);
  return dots;
}

DirectionMixTexture TextureTable::MakeDirectionMix(ParameterList& parameters, bool is_color,
                                                   const Matrix4& world_from_texture) {
  DirectionMixTexture mix;
  const Vec3f d = parameters.GetVector3("dir", mix.direction);
  const Vec3d world = TransformVector(world_from_texture, ToDouble(d));
  const double length = Length(world);
  if (length > 0 && std::isfinite(length)) {
    mix.direction = ToFloat(world / length);
  } else {
    parameters.Error(absl::StrCat(parameters.owner(), ": \"vector3 dir\" has no direction"));
  }
  GetPair(*this, parameters, is_color, {"tex1", "tex2"}, 0, &mix);
  return mix;
}

BilerpTexture TextureTable::MakeBilerp(ParameterList& parameters, bool is_color,
                                       const Matrix4& world_from_texture) {
  BilerpTexture bilerp;
  bilerp.mapping = GetUvMapping(parameters, world_from_texture);
  constexpr std::array<const char*, 4> kNames = {"v00", "v10", "v01", "v11"};
  for (size_t i = 0; i < kNames.size(); ++i) {
    if (is_color) {
      bilerp.color[i] = GetColor(parameters, kNames[i], ColorRole::kReflectance,
                                 RgbColor(Rgb::Gray(bilerp.value[i])), *files_);
    } else {
      bilerp.value[i] = parameters.GetFloat(kNames[i], bilerp.value[i]);
    }
  }
  return bilerp;
}

}  // namespace sheaf
