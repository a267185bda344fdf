// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/material/texture_program.h"

#include <algorithm>
#include <cmath>

#include "common/base/check.h"
#include "common/math/elementary.h"
#include "worker/render/color/file_primaries.h"
#include "worker/render/material/material.h"
#include "worker/render/material/node_textures.h"

namespace sheaf::render {
namespace {

// Beyond this, coordinates have no useful fraction; also keeps them in the range of int64_t.
constexpr double kCoordinateMax = 0x1p50;

double Sanitize(double coordinate) {
  return std::isfinite(coordinate) ? std::clamp(coordinate, -kCoordinateMax, kCoordinateMax) : 0;
}

// Reduces an image coordinate: only the fraction matters where the image repeats.
float Reduce(double coordinate, TextureWrap wrap) {
  const double finite = Sanitize(coordinate);
  if (wrap == TextureWrap::kMirror) {
    return static_cast<float>(finite - 2 * std::floor(0.5 * finite));
  }
  return static_cast<float>(wrap == TextureWrap::kRepeat ? finite - std::floor(finite)
                                                         : std::clamp(finite, -2.0, 3.0));
}

// Steps for slopes, in uv where nothing has a scale: pbrt-v4's. The edges of a pattern are as
// narrow, in parts of a cell; beside an image they only bound the step.
constexpr double kSlopeStepWithoutScale = 0.0005f, kSlopeStepMin = 0x1p-60, kSlopeStepMax = 0.25;
constexpr double kEdgeOfCell = 0.0005f, kEdgeOfCellMax = 0.125;
// For images by position: nearly the slope at the point itself.
constexpr double kTexelPart = 1.0 / 16;
// Nearer to an axis than this part of the distance to the center, angles about it turn no faster.
constexpr double kAxisMin = 0x1p-20;

Vec2d Least(Vec2d a, Vec2d b) { return {std::fmin(a.x, b.x), std::fmin(a.y, b.y)}; }
Vec2d Step(Vec2d half_texel, Vec2d cell) {
  const auto along = [](double texel, double side) {
    if (std::isfinite(texel)) return std::fmin(texel, side * kEdgeOfCellMax);
    return std::isfinite(side) ? side * kEdgeOfCell : kSlopeStepWithoutScale;
  };
  return {along(half_texel.x, cell.x), along(half_texel.y, cell.y)};
}

Rgb WithoutNegative(Rgb c) {
  return {std::fmax(c.r, 0.0f), std::fmax(c.g, 0.0f), std::fmax(c.b, 0.0f)};
}

int Modulo(int a, int n) {
  if (a >= 0 && a < n) return a;  // Nearly always.
  const int r = a % n;
  return r < 0 ? r + n : r;
}

float ChannelOf(const Texel& texel, int channels, int channel) {
  if (channel == 3) return channels == 4 ? texel[3] : 1;
  return texel[channels == 1 ? 0 : static_cast<size_t>(channel)];
}

// Along one axis of n texels; false where the mode gives black.
bool WrapAlong(TextureWrap wrap, int n, int& i) {
  switch (wrap) {
    case TextureWrap::kRepeat:
      i = Modulo(i, n);
      return true;
    case TextureWrap::kMirror: {
      const int r = Modulo(i, 2 * n);
      i = r < n ? r : 2 * n - 1 - r;
      return true;
    }
    case TextureWrap::kBlack:
      return i >= 0 && i < n;
    case TextureWrap::kClamp:
    case TextureWrap::kOctahedral:
      i = std::clamp(i, 0, n - 1);
      return true;
  }
  return false;
}

}  // namespace

bool WrapTexel(TextureWrap wrap_x, TextureWrap wrap_y, int width, int height, TexelIndex& texel) {
  return WrapAlong(wrap_x, width, texel.x) && WrapAlong(wrap_y, height, texel.y);
}

bool WrapTexel(TextureWrap wrap, int width, int height, TexelIndex& texel) {
  if (wrap != TextureWrap::kOctahedral) return WrapTexel(wrap, wrap, width, height, texel);
  // Each edge of the octahedral map adjoins itself, reversed.
  texel = {std::clamp(texel.x, -width, 2 * width - 1),
           std::clamp(texel.y, -height, 2 * height - 1)};
  if (texel.x < 0 || texel.x >= width) {
    texel.x = texel.x < 0 ? -1 - texel.x : 2 * width - 1 - texel.x;
    texel.y = height - 1 - texel.y;
  }
  if (texel.y < 0 || texel.y >= height) {
    texel.y = texel.y < 0 ? -1 - texel.y : 2 * height - 1 - texel.y;
    texel.x = width - 1 - texel.x;
  }
  return true;
}

ColorOperand TextureProgram::Operand(const ColorInput& input, ColorRole role) const {
  if (input.texture == kNone) {
    const SpectralColor spectrum =
        spectral_ ? SpectralColor::Make(input.value, role) : SpectralColor();
    return {kNone, input.value.rgb, spectrum};
  }
  const Node& node = nodes_[static_cast<size_t>(input.texture)];
  SHEAF_CHECK(node.is_color);
  if (node.kind == Kind::kConstant) return node.color[0];
  return {input.texture, {}, {}};
}

FloatOperand TextureProgram::Operand(const FloatInput& input) const {
  if (input.texture == kNone) return {kNone, input.value};
  const Node& node = nodes_[static_cast<size_t>(input.texture)];
  SHEAF_CHECK(!node.is_color);
  if (node.kind == Kind::kConstant) return {kNone, node.value[0].value};
  return {input.texture, 0};
}

int TextureProgram::ImageChannels(int32_t texture) const {
  const Node& node = nodes_[static_cast<size_t>(texture)];
  return node.kind == Kind::kImage ? node.image.channels : 0;
}

TextureProgram::SlopeScale TextureProgram::SlopeScaleOf(const FloatOperand& operand) const {
  SlopeScale scale;
  std::vector<int32_t> open;
  if (operand.texture != kNone) open.push_back(operand.texture);
  // Nesting is bounded by kEvaluationsMax.
  while (!open.empty()) {
    const int32_t texture = open.back();
    const Node& node = nodes_[static_cast<size_t>(texture)];
    open.pop_back();
    const bool has_scale = node.mapping_index != kNone;
    const bool is_node = node.kind == Kind::kNode, on_uv = is_node && NodeOf(node).from_uv;
    const bool has_3d =
        node.kind == Kind::kCheckerboard3 || node.kind == Kind::kNoise || (is_node && !on_uv);
    if (on_uv) {
      scale.half_texel = Least(scale.half_texel, 0.5 * FinestUvCell(node));
    } else if (has_scale && (node.mapping != UvMapping::Kind::kUv || has_3d)) {
      scale.by_position.push_back(texture);
    } else if (has_scale) {
      const Mapping& m = mappings_[static_cast<size_t>(node.mapping_index)];
      // The parts of uv over which s or t changes by `part` of a unit that is cut into nx and ny.
      const auto over = [&](float part, float nx, float ny) {
        return Vec2d{std::fmin(part / std::fabs(m.scale_u * nx), part / std::fabs(m.turn_v * ny)),
                     std::fmin(part / std::fabs(m.scale_v * ny), part / std::fabs(m.turn_u * nx))};
      };
      if (node.kind == Kind::kImage) {
        scale.half_texel = Least(scale.half_texel, over(0.5f, static_cast<float>(node.image.width),
                                                        static_cast<float>(node.image.height)));
      } else {
        scale.cell = Least(scale.cell, over(1, 1, 1));
      }
    }
    for (const FloatOperand& child : {node.value[0], node.value[1], node.amount}) {
      if (child.texture != kNone) open.push_back(child.texture);
    }
  }
  const Vec2d step = Step(scale.half_texel, scale.cell);
  scale.step = {std::clamp(step.x, kSlopeStepMin, kSlopeStepMax),
                std::clamp(step.y, kSlopeStepMin, kSlopeStepMax)};
  return scale;
}

Vec2d TextureProgram::SlopeStep(const SlopeScale& scale, const TexturePoint& point, Vec3d dpdu,
                                Vec3d dpdv) const {
  if (scale.by_position.empty()) return scale.step;
  double texel = SlopeScale::kNoScale, cell = SlopeScale::kNoScale;  // Lengths.
  for (const int32_t texture : scale.by_position) {
    const Node& node = nodes_[static_cast<size_t>(texture)];
    if (node.kind == Kind::kCheckerboard3) {
      const Mapping& m = mappings_[static_cast<size_t>(node.mapping_index)];
      for (const Vec3d& row : m.rows) cell = std::fmin(cell, 1 / Length(row));
      continue;
    }
    if (node.kind == Kind::kNoise || node.kind == Kind::kNode) {
      texel = std::fmin(texel, FinestCell(node));
      continue;
    }
    const Vec2d lengths = LengthsOf(node, point);
    if (node.kind == Kind::kImage) {
      texel =
          std::fmin(texel, std::fmin(lengths.x / node.image.width, lengths.y / node.image.height));
    } else {
      cell = std::fmin(cell, std::fmin(lengths.x, lengths.y));
    }
  }
  const auto in_uv = [&](double length) {
    return Vec2d{length / Length(dpdu), length / Length(dpdv)};
  };
  const Vec2d step =
      Step(Least(scale.half_texel, in_uv(texel * kTexelPart)), Least(scale.cell, in_uv(cell)));
  const auto usable = [](double x) {
    return x > 0 && std::isfinite(x) ? x : kSlopeStepWithoutScale;
  };
  return {usable(step.x), usable(step.y)};
}

Vec2d TextureProgram::LengthsOf(const Node& node, const TexturePoint& point) const {
  const Mapping& m = mappings_[static_cast<size_t>(node.mapping_index)];
  const auto length = [&](Vec3d gradient) { return 1 / Length(m.GradientInWorld(gradient)); };
  if (node.mapping == UvMapping::Kind::kPlanar) return {length(m.planar_u), length(m.planar_v)};
  const Vec3d p = m.PointInTexture(point.p_world);
  const double center2 = LengthSquared(p);
  const double axis2 = std::fmax(p.x * p.x + p.y * p.y, center2 * kAxisMin * kAxisMin);
  const double around = length(Vec3d{-p.y, p.x, 0} / (2 * kPi * axis2));
  if (node.mapping == UvMapping::Kind::kCylindrical) return {around, length({0, 0, 1})};
  const double axis = std::sqrt(axis2);
  return {length(Vec3d{p.x * p.z / axis, p.y * p.z / axis, -axis} / (kPi * center2)), around};
}

// Source of the mappings: pbrt-v4, sec. 10.2 ("Texture Coordinate Generation").
Vec2d TextureProgram::MapTo2d(const Node& node, const TexturePoint& point) const {
  const Mapping& m = mappings_[static_cast<size_t>(node.mapping_index)];
  const bool is_second = node.mapping == UvMapping::Kind::kSecondUv;
  if (node.mapping == UvMapping::Kind::kUv || is_second) {
    const Vec2f from = is_second ? Vec2f{point.color[0], point.color[1]} : point.uv;
    const double du = point.uv_shift.x, dv = point.uv_shift.y;
    Vec2f uv{m.scale_u * from.x + m.offset_u, m.scale_v * from.y + m.offset_v};
    if (m.turn_u == 0 && m.turn_v == 0) return {uv.x + m.scale_u * du, uv.y + m.scale_v * dv};
    uv = uv + Vec2f{m.turn_u * from.y, m.turn_v * from.x};
    return {uv.x + (m.scale_u * du + m.turn_u * dv), uv.y + (m.scale_v * dv + m.turn_v * du)};
  }
  const Vec3d p_texture = m.PointInTexture(point.p_world);
  const Vec3f p = ToFloat(p_texture);
  const auto inv_pi = static_cast<float>(1 / kPi);
  switch (node.mapping) {
    case UvMapping::Kind::kPlanar:
      return {m.offset_u + Dot(p_texture, m.planar_u), m.offset_v + Dot(p_texture, m.planar_v)};
    case UvMapping::Kind::kSpherical: {
      // atan2 instead of acos keeps the precision at the poles.
      const float theta = Atan2(std::sqrt(p.x * p.x + p.y * p.y), p.z);
      const float phi = Atan2(p.y, p.x);
      return {theta * inv_pi, (phi < 0 ? phi * 0.5f * inv_pi + 1 : phi * 0.5f * inv_pi)};
    }
    case UvMapping::Kind::kCylindrical:
      return {0.5f + Atan2(p.y, p.x) * 0.5f * inv_pi, p_texture.z};
    case UvMapping::Kind::kUv:
    case UvMapping::Kind::kSecondUv:
      break;
  }
  return {};
}

bool TextureProgram::IsOddCell(const Node& node, const TexturePoint& point) const {
  const auto cell = [](double x) { return static_cast<int64_t>(std::floor(Sanitize(x))); };
  if (node.kind == Kind::kCheckerboard2) {
    const Vec2d st = MapTo2d(node, point);
    return ((cell(st.x) + cell(st.y)) & 1) != 0;
  }
  const Vec3d p = PointOf(node, point);
  return ((cell(p.x) + cell(p.y) + cell(p.z)) & 1) != 0;
}

Texel TextureProgram::LookUp(const Node& node, const TexturePoint& point) const {
  const Vec2d st = MapTo2d(node, point);
  // Rows are stored from the top; t points upwards.
  const float x = Reduce(st.x, node.wrap) * static_cast<float>(node.image.width) - 0.5f;
  const float y = Reduce(1 - st.y, node.wrap_v) * static_cast<float>(node.image.height) - 0.5f;
  const float x_floor = std::floor(node.nearest ? x + 0.5f : x);
  const float y_floor = std::floor(node.nearest ? y + 0.5f : y);
  const int x0 = static_cast<int>(x_floor), y0 = static_cast<int>(y_floor);
  const float fx = x - x_floor, fy = y - y_floor;
  const size_t count = node.nearest ? 1 : 4;
  TexelIndex where[4] = {{x0, y0}, {x0 + 1, y0}, {x0, y0 + 1}, {x0 + 1, y0 + 1}};
  float weight[4] = {(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy};
  if (node.nearest) weight[0] = 1;
  for (size_t i = 0; i < count; ++i) {
    const bool inside =
        node.wrap == TextureWrap::kOctahedral
            ? WrapTexel(node.wrap, node.image.width, node.image.height, where[i])
            : WrapTexel(node.wrap, node.wrap_v, node.image.width, node.image.height, where[i]);
    if (inside) continue;
    where[i] = {0, 0};
    weight[i] = 0;
  }
  Texel values[4];
  cache_->ReadTexels(node.image.index, {where, count}, {values, count});
  Texel sum{};
  for (size_t i = 0; i < count; ++i) {
    for (size_t c = 0; c < sum.size(); ++c) sum[c] += weight[i] * values[i][c];
  }
  return sum;
}

Rgb TextureProgram::ImageColor(const Node& node, const TexturePoint& point) const {
  const Texel texel = LookUp(node, point);
  Rgb color = node.image.channels == 1 ? Rgb::Gray(texel[0]) : Rgb{texel[0], texel[1], texel[2]};
  color *= node.tint * node.scale;
  if (node.invert) color = Rgb::Gray(1) - color;
  // This form keeps NaN, so that a failed read is noticed.
  for (size_t c = 0; c < 3; ++c) color[c] = color[c] < 0 ? 0 : color[c];
  color *= node.factor;
  if (node.primaries_index == kNone) return color;
  // As in pbrt-v4, a reflectance ends at 1 in its own primaries. Gray stays gray to the bit.
  if (node.role == ColorRole::kReflectance) {
    for (size_t c = 0; c < 3; ++c) color[c] = color[c] > 1 ? 1 : color[c];
  }
  const bool is_gray = color.r == color.g && color.g == color.b;
  if (is_gray && node.role != ColorRole::kIlluminant) return color;
  MoveToSrgb(primaries_[static_cast<size_t>(node.primaries_index)], &color);
  return color;
}

template <typename Color>
Color TextureProgram::Evaluate(int32_t texture, const TexturePoint& point,
                               const WavelengthsOf<Color>& wavelengths) const {
  const Node& node = nodes_[static_cast<size_t>(texture)];
  const auto value = [&](size_t i) { return Value<Color>(node.color[i], point, wavelengths); };
  switch (node.kind) {
    case Kind::kConstant:
      return value(0);
    case Kind::kImage:
      return ColorOfRgb<Color>(ImageColor(node, point), node.role, wavelengths);
    case Kind::kCheckerboard2:
    case Kind::kCheckerboard3:
      return value(IsOddCell(node, point) ? 1 : 0);
    case Kind::kScale:
      return value(0) * Float(node.amount, point);
    case Kind::kMix: {
      const float amount = Float(node.amount, point);
      return value(0) * (1 - amount) + value(1) * amount;
    }
    case Kind::kVertexColor: {
      // The product is that of colors, whatever the transport.
      const Rgb base = Value<Rgb>(node.color[0], point, {});
      const VertexColor& c = point.color;
      return ColorOfRgb<Color>(base * Rgb{c[0], c[1], c[2]}, node.role, wavelengths);
    }
    case Kind::kMarble:
      return ColorOfRgb<Color>(MarbleAt(node, point), node.role, wavelengths);
    case Kind::kDots:
      return value(IsInDot(node, point) ? 0 : 1);
    case Kind::kDirectionMix: {
      const float share = ShareAlong(node, point);
      return value(0) * share + value(1) * (1 - share);
    }
    case Kind::kBilerp: {
      const CornerWeights weights = CornersAt(node, point);
      const Pattern& pattern = PatternOf(node);
      Color sum{};
      for (size_t i = 0; i < 4; ++i) {
        sum += ConstantOf(pattern.corner_color[i], wavelengths) * weights.at[i];
      }
      return sum;
    }
    case Kind::kNode: {
      const bool is_attribute = NodeOf(node).kind == NodeTexture::Kind::kAttribute;
      const Rgb color = is_attribute ? Rgb{point.color[0], point.color[1], point.color[2]}
                                     : NodeColor(NodeOf(node), PointOf(node, point));
      return ColorOfRgb<Color>(WithoutNegative(color), node.role, wavelengths);
    }
    case Kind::kRamp: {
      const Rgb color = RampAt(RampOf(node), Float(node.amount, point), true);
      return ColorOfRgb<Color>(color, node.role, wavelengths);
    }
    case Kind::kNoise:
      break;  // A float texture.
  }
  return {};
}

template Rgb TextureProgram::Evaluate<Rgb>(int32_t, const TexturePoint&,
                                           const NoWavelengths&) const;
template Spectral TextureProgram::Evaluate<Spectral>(int32_t, const TexturePoint&,
                                                     const Wavelengths&) const;

float TextureProgram::EvaluateFloat(int32_t texture, const TexturePoint& point) const {
  const Node& node = nodes_[static_cast<size_t>(texture)];
  switch (node.kind) {
    case Kind::kConstant:
      return node.value[0].value;
    case Kind::kImage: {
      const Texel texel = LookUp(node, point);
      // An image with alpha acts as a mask, as in pbrt-v4; one without acts as its mean.
      float value = texel[0];
      if (node.image.channels == 3) value = (texel[0] + texel[1] + texel[2]) * (1.0f / 3);
      if (node.image.channels == 4) value = texel[3];
      if (node.channel != kNone) value = ChannelOf(texel, node.image.channels, node.channel);
      value *= node.scale;
      if (node.is_threshold) return value >= node.threshold ? 1 : 0;
      if (!node.invert) return value;
      return value > 1 ? 0 : 1 - value;
    }
    case Kind::kCheckerboard2:
    case Kind::kCheckerboard3:
      return Float(node.value[IsOddCell(node, point) ? 1 : 0], point);
    case Kind::kScale:
      return Float(node.value[0], point) * Float(node.amount, point);
    case Kind::kMix: {
      const float amount = Float(node.amount, point);
      return Float(node.value[0], point) * (1 - amount) + Float(node.value[1], point) * amount;
    }
    case Kind::kVertexColor:
      return Float(node.value[0], point) * point.color[3];
    case Kind::kNoise:
      return NoiseAt(node, point);
    case Kind::kDots:
      return Float(node.value[IsInDot(node, point) ? 0 : 1], point);
    case Kind::kDirectionMix: {
      const float share = ShareAlong(node, point);
      return Float(node.value[0], point) * share + Float(node.value[1], point) * (1 - share);
    }
    case Kind::kBilerp: {
      const CornerWeights weights = CornersAt(node, point);
      float sum = 0;
      for (size_t i = 0; i < 4; ++i) sum += PatternOf(node).corner_value[i] * weights.at[i];
      return sum;
    }
    case Kind::kNode:
      if (NodeOf(node).kind == NodeTexture::Kind::kAttribute) {
        return AttributeFactor(NodeOf(node), point.color);
      }
      return NodeFactor(NodeOf(node), PointOf(node, point));
    case Kind::kRamp:
      return RampAt(RampOf(node), Float(node.amount, point), false).r;
    case Kind::kMarble:
      break;  // A color texture.
  }
  return 0;
}

}  // namespace sheaf::render
