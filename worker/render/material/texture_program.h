// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TextureProgram: the scene's textures as a flat array of nodes that refer to each other by index,
// evaluated by a switch. What does not vary over a surface is folded into a constant when the
// program is made.
//
// Image textures are looked up in the image as it is stored, bilinearly (or at the nearest texel),
// whatever filter and footprint: a pixel's samples already average over its footprint, exactly and
// without the blur of prefiltered levels.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "common/image/texture_cache.h"
#include "common/math/vec.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "worker/render/color/spectral_color.h"
#include "worker/render/color/wavelengths.h"

namespace sheaf::render {

struct TexturePoint;

// A constant, or the texture that gives the value at a point.
struct ColorOperand {
  int32_t texture = kNone;
  Rgb value;
  SpectralColor
      spectrum;  // The constant as spectral transport sees it; black in a program for RGB.
};
struct FloatOperand {
  int32_t texture = kNone;
  float value = 0;
};

// Wraps texel indices; false where the wrap mode says black. Requires: width, height > 0.
bool WrapTexel(TextureWrap wrap, int width, int height, TexelIndex& texel);

class TextureProgram {
 public:
  // Errors: an image that cannot be read or decoded; textures that refer to themselves; nesting
  // that evaluates more than kEvaluationsMax nodes for one look-up. Messages begin with the
  // texture's place. Warns about texels that are not finite. cache must outlive *this.
  static absl::StatusOr<TextureProgram> Build(const SceneDescription& scene, FileSource& files,
                                              TextureCache& cache, bool spectral);

  // Constants where the texture does not vary. role: of a constant that is no texture.
  ColorOperand Operand(const ColorInput& input, ColorRole role) const;
  FloatOperand Operand(const FloatInput& input) const;

  // Color: Rgb, or, in a program made for spectra, Spectral at the wavelengths.
  template <typename Color>
  Color Value(const ColorOperand& operand, const TexturePoint& point,
              const WavelengthsOf<Color>& wavelengths) const {
    if (operand.texture != kNone) return Evaluate<Color>(operand.texture, point, wavelengths);
    return ConstantOf(operand, wavelengths);
  }
  float Float(const FloatOperand& operand, const TexturePoint& point) const {
    return operand.texture == kNone ? operand.value : EvaluateFloat(operand.texture, point);
  }

  // Of an image texture; 0 for any other.
  int ImageChannels(int32_t texture) const;
  // How far in u and v to go either way for a slope: half a texel of the finest image mapped by uv,
  // over which the slope of the bilinear picture becomes continuous; the step of pbrt-v4 where
  // there is none.
  Vec2f SlopeStep(const FloatOperand& operand) const;

  static constexpr uint64_t kEvaluationsMax = 4096;

 private:
  enum class Kind : uint8_t { kConstant, kImage, kCheckerboard2, kCheckerboard3, kScale, kMix };
  struct Node {
    Kind kind = Kind::kConstant;
    UvMapping::Kind mapping = UvMapping::Kind::kUv;
    TextureWrap wrap = TextureWrap::kRepeat;
    bool is_color = false, nearest = false, invert = false;
    ColorRole role = ColorRole::kReflectance;  // Of an image's colours.
    int32_t mapping_index = kNone;             // In mappings_.
    TextureImage image;
    float scale = 1;
    ColorOperand color[2];
    FloatOperand value[2];
    FloatOperand amount;  // Of mixing; factor of scaling.
  };
  // Mappings in float, ready for use.
  struct Mapping {
    float scale_u = 1, scale_v = 1, offset_u = 0, offset_v = 0;
    Vec3f planar_u, planar_v;
    Vec3f rows[3];  // texture_from_world, linear part.
    Vec3f origin;   // And translation.
  };
  class Builder;

  static Rgb ConstantOf(const ColorOperand& operand, NoWavelengths) { return operand.value; }
  static Spectral ConstantOf(const ColorOperand& operand, const Wavelengths& wavelengths) {
    return operand.spectrum.At(wavelengths);
  }
  template <typename Color>
  Color Evaluate(int32_t texture, const TexturePoint& point,
                 const WavelengthsOf<Color>& wavelengths) const;
  float EvaluateFloat(int32_t texture, const TexturePoint& point) const;
  Vec2f MapTo2d(const Node& node, const TexturePoint& point) const;
  bool IsOddCell(const Node& node, const TexturePoint& point) const;
  Texel LookUp(const Node& node, const TexturePoint& point) const;

  bool spectral_ = false;
  const TextureCache* cache_ = nullptr;
  std::vector<Node> nodes_;  // As SceneDescription::textures.
  std::vector<Mapping> mappings_;
};

}  // namespace sheaf::render
