// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TextureProgram: the scene's textures as a flat array of nodes that refer to each other by index,
// evaluated by a switch. Constant subexpressions are folded when the program is built.
//
// Image textures are sampled in the stored image, bilinearly (or at the nearest texel), for any
// filter and footprint: a pixel's samples already average over its footprint, exactly and without
// the blur of prefiltered levels.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "common/image/texture_cache.h"
#include "common/math/transform.h"
#include "common/math/vec.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "worker/render/color/spectral_color.h"
#include "worker/render/color/wavelengths.h"

namespace sheaf::render {

struct TexturePoint;

// A constant, or a texture.
struct ColorOperand {
  int32_t texture = kNone;
  Rgb value;
  SpectralColor spectrum;  // The constant for spectral transport; black in an RGB program.
};
struct FloatOperand {
  int32_t texture = kNone;
  float value = 0;
};

// Wraps texel indices; returns false where the wrap mode gives black. Requires: width, height > 0.
bool WrapTexel(TextureWrap wrap, int width, int height, TexelIndex& texel);
// The same with modes of their own along x and y, neither of which is kOctahedral.
bool WrapTexel(TextureWrap wrap_x, TextureWrap wrap_y, int width, int height, TexelIndex& texel);

class TextureProgram {
 public:
  // Errors: an image that cannot be read or decoded; textures that refer to themselves; nesting
  // that evaluates more than kEvaluationsMax nodes per lookup. Messages begin with the texture's
  // location. Warns about non-finite texels and colors outside of sRGB. cache must outlive *this.
  static absl::StatusOr<TextureProgram> Build(const SceneDescription& scene, FileSource& files,
                                              TextureCache& cache, bool spectral);

  // Returns a constant where the texture is constant. role: of a constant input.
  ColorOperand Operand(const ColorInput& input, ColorRole role) const;
  FloatOperand Operand(const FloatInput& input) const;

  // Color: Rgb, or Spectral at the wavelengths in a program built for spectra.
  template <typename Color>
  Color Value(const ColorOperand& operand, const TexturePoint& point,
              const WavelengthsOf<Color>& wavelengths) const {
    if (operand.texture != kNone) return Evaluate<Color>(operand.texture, point, wavelengths);
    return ConstantOf(operand, wavelengths);
  }
  float Float(const FloatOperand& operand, const TexturePoint& point) const {
    return operand.texture == kNone ? operand.value : EvaluateFloat(operand.texture, point);
  }

  // Number of channels of an image texture; 0 for any other.
  int ImageChannels(int32_t texture) const;
  // The sizes from which the steps for the slopes of a texture follow.
  struct SlopeScale {
    // For textures mapped by uv, in uv: half a texel of the finest image, and a side of the
    // smallest cell; infinite where there is none.
    Vec2d half_texel{kNoScale, kNoScale}, cell{kNoScale, kNoScale};
    std::vector<int32_t> by_position;  // The textures whose scale depends on the point.
    Vec2d step;                        // In uv, if by_position is empty.
    static constexpr double kNoScale = std::numeric_limits<double>::infinity();
  };
  SlopeScale SlopeScaleOf(const FloatOperand& operand) const;
  // Half the interval in u and v for finite differences: half a texel of the finest image mapped by
  // uv, over which the slope of bilinear interpolation becomes continuous; a part of one mapped by
  // position; in patterns without an image, a part of a cell. dpdu, dpdv: of the surface at the
  // point, in world space.
  Vec2d SlopeStep(const SlopeScale& scale, const TexturePoint& point, Vec3d dpdu, Vec3d dpdv) const;

  static constexpr uint64_t kEvaluationsMax = 4096;

 private:
  enum class Kind : uint8_t {
    kConstant,
    kImage,
    kCheckerboard2,
    kCheckerboard3,
    kScale,
    kMix,
    kVertexColor,
    kNoise,
    kMarble,
    kDots,
    kDirectionMix,
    kBilerp,
    kNode,
    kRamp
  };
  struct Node {
    Kind kind = Kind::kConstant;
    UvMapping::Kind mapping = UvMapping::Kind::kUv;
    TextureWrap wrap = TextureWrap::kRepeat, wrap_v = TextureWrap::kRepeat;
    bool is_color = false, nearest = false, invert = false;
    int8_t channel = kNone;     // For an image as a float texture; kNone: pbrt-v4's choice.
    bool is_threshold = false;  // Its values are 1 from `threshold` on, else 0.
    float threshold = 0;
    Rgb tint = Rgb::Gray(1);
    ColorRole role = ColorRole::kReflectance;  // Role of the colors of an image.
    int32_t mapping_index = kNone;             // In mappings_.
    int32_t pattern_index = kNone;             // In patterns_, node_textures_ or ramps_.
    TextureImage image;
    float scale = 1;
    float factor = 1;                 // For an image as a color texture, after invert.
    int32_t primaries_index = kNone;  // In primaries_, of an image in other primaries than sRGB.
    ColorOperand color[2];
    FloatOperand value[2];
    FloatOperand amount;  // Mixing weight, or scale factor.
  };
  // Mappings, ready for use. Those by position are in double: a scene may lie at 10^7 units, where
  // neighboring floats are a unit apart.
  struct Mapping {
    float scale_u = 1, scale_v = 1, offset_u = 0, offset_v = 0;
    float turn_u = 0, turn_v = 0;
    Vec3d planar_u, planar_v;
    Vec3d rows[3];  // Linear part of texture_from_world.
    Vec3d origin;   // Its translation.
    Vec3d PointInTexture(Vec3d p_world) const {
      return Vec3d{Dot(rows[0], p_world), Dot(rows[1], p_world), Dot(rows[2], p_world)} + origin;
    }
    // The gradient over world space of a function with this gradient over texture space.
    Vec3d GradientInWorld(Vec3d g) const { return rows[0] * g.x + rows[1] * g.y + rows[2] * g.z; }
  };
  // The numbers of the textures of pattern_textures.h.
  struct Pattern {
    NoiseTexture::Kind noise = NoiseTexture::Kind::kFbm;
    int octaves = 0;
    double roughness = 0, scale = 1, variation = 0;
    Vec3f direction{};
    ColorOperand corner_color[4];
    float corner_value[4] = {};
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
  Vec2d MapTo2d(const Node& node, const TexturePoint& point) const;
  // The lengths in world space over which s and t change by 1, for mappings by position.
  Vec2d LengthsOf(const Node& node, const TexturePoint& point) const;
  bool IsOddCell(const Node& node, const TexturePoint& point) const;
  Texel LookUp(const Node& node, const TexturePoint& point) const;
  Rgb ImageColor(const Node& node, const TexturePoint& point) const;
  // By texture_patterns.cc.
  const Pattern& PatternOf(const Node& node) const {
    return patterns_[static_cast<size_t>(node.pattern_index)];
  }
  Vec3d PointOf(const Node& node, const TexturePoint& point) const;
  float NoiseAt(const Node& node, const TexturePoint& point) const;
  Rgb MarbleAt(const Node& node, const TexturePoint& point) const;
  bool IsInDot(const Node& node, const TexturePoint& point) const;
  float ShareAlong(const Node& node, const TexturePoint& point) const;
  const NodeTexture& NodeOf(const Node& node) const {
    return node_textures_[static_cast<size_t>(node.pattern_index)];
  }
  // The ramp's color, or its value in all channels, at the value of its input.
  static Rgb RampAt(const RampTexture& ramp, float input, bool is_color);
  const RampTexture& RampOf(const Node& node) const {
    return ramps_[static_cast<size_t>(node.pattern_index)];
  }
  // The weights of a bilerp's corners.
  struct CornerWeights {
    float at[4];
  };
  CornerWeights CornersAt(const Node& node, const TexturePoint& point) const;
  // The width of a cell of the finest octave, in world space, or, of a node on uv, in u and v.
  double FinestCell(const Node& node) const;
  Vec2d FinestUvCell(const Node& node) const;

  bool spectral_ = false;
  const TextureCache* cache_ = nullptr;
  std::vector<Node> nodes_;  // As SceneDescription::textures.
  std::vector<Mapping> mappings_;
  std::vector<Pattern> patterns_;
  std::vector<NodeTexture> node_textures_;
  std::vector<RampTexture> ramps_;
  std::vector<Matrix4> primaries_;  // To linear sRGB.
};

}  // namespace sheaf::render
