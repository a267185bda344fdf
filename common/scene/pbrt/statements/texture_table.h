// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TextureTable: the named textures of a scene, and the parameters that may refer to one. Materials
// may use a texture that the file declares later; the table reserves its index until then.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <tuple>

#include "common/scene/pbrt/statements/scene_files.h"
#include "common/scene/pbrt/syntax/parameter_list.h"
#include "common/scene/scene_description.h"

namespace sheaf {

class TextureTable {
 public:
  // Requires: all pointers outlive this.
  TextureTable(SceneDescription* scene, SceneFiles* files, Diagnostics* diagnostics)
      : scene_(scene), files_(files), diagnostics_(diagnostics) {}

  // Texture "name" "float|spectrum" "kind" ... with the current transformation.
  void Declare(const std::string& name, const std::string& type, const std::string& kind,
               const Matrix4& world_from_texture, ParameterList parameters);

  FloatInput GetFloatInput(ParameterList& parameters, const std::string& name, float fallback);
  ColorInput GetColorInput(ParameterList& parameters, const std::string& name, ColorRole role,
                           const ColorSpec& fallback);

  // The image that "string normalmap" names, as a texture of its own: repeating, bilinear, its
  // values taken without decoding. kNone if there is no such parameter.
  int32_t GetNormalMap(ParameterList& parameters);

  // Gives textures that are used in several roles (reflectance, unbounded) a copy for each, and
  // reports undefined references. Call once, at the end of the scene.
  void Finish();

 private:
  // A texture is requested for a type and a role, on which the colors of spectra depend.
  using Key = std::tuple<bool, ColorRole, std::string>;
  struct Slot {
    int32_t index = kNone;
    bool is_declared = false;
  };

  // Index of the texture that the parameter names. Within a texture's declaration, kNone (reported)
  // if it is not declared before, which also rules out cycles.
  int32_t Refer(ParameterList& parameters, const Parameter& parameter, bool is_color,
                ColorRole role);
  Slot& SlotFor(bool is_color, ColorRole role, const std::string& name, SourceLocation location);
  void CopyForRole(int32_t source, int32_t target, ColorRole role);

  ImageTexture MakeImage(ParameterList& parameters, const Matrix4& world_from_texture);
  CheckerboardTexture MakeCheckerboard(ParameterList& parameters, bool is_color,
                                       const Matrix4& world_from_texture);
  ScaleTexture MakeScale(ParameterList& parameters, bool is_color);
  MixTexture MakeMix(ParameterList& parameters, bool is_color);
  ConstantTexture MakeConstant(ParameterList& parameters, bool is_color);
  // In texture_table_patterns.cc.
  NoiseTexture MakeNoise(ParameterList& parameters, NoiseTexture::Kind kind,
                         const Matrix4& world_from_texture);
  MarbleTexture MakeMarble(ParameterList& parameters, const Matrix4& world_from_texture);
  DotsTexture MakeDots(ParameterList& parameters, bool is_color, const Matrix4& world_from_texture);
  DirectionMixTexture MakeDirectionMix(ParameterList& parameters, bool is_color,
                                       const Matrix4& world_from_texture);
  BilerpTexture MakeBilerp(ParameterList& parameters, bool is_color,
                           const Matrix4& world_from_texture);
  NodeTexture MakeNode(ParameterList& parameters, const Matrix4& world_from_texture);
  RampTexture MakeRamp(ParameterList& parameters, bool is_color);
  // The class's texture; nothing (reported) if there is none of the type.
  std::optional<decltype(TextureDescription::texture)> Make(ParameterList& parameters,
                                                            const std::string& kind, bool is_color,
                                                            const Matrix4& world_from_texture);

  SceneDescription* scene_;
  SceneFiles* files_;
  Diagnostics* diagnostics_;
  std::map<Key, Slot> slots_;
  bool is_declaring_ = false;
};

// The inverse of the current transformation, which is reported if it is singular.
Matrix4 TextureFromWorld(ParameterList& parameters, const Matrix4& world_from_texture);

// Reads "mapping" and its parameters.
UvMapping GetUvMapping(ParameterList& parameters, const Matrix4& world_from_texture);

}  // namespace sheaf
