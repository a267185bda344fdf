// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/material/texture_program.h"

#include <algorithm>
#include <cmath>

#include "common/base/check.h"
#include "common/math/elementary.h"
#include "worker/render/material/material.h"

namespace sheaf::render {
namespace {

// Beyond this, float coordinates have no useful fraction; also keeps them in the range of int.
constexpr float kCoordinateMax = 1e6f;

float Sanitize(float coordinate) {
  return std::isfinite(coordinate) ? std::clamp(coordinate, -kCoordinateMax, kCoordinateMax) : 0.0f;
}

// Reduces an image coordinate: only the fraction matters where the image repeats.
float Reduce(float coordinate, TextureWrap wrap) {
  const float finite = Sanitize(coordinate);
  if (wrap == TextureWrap::kMirror) return finite - 2 * std::floor(0.5f * finite);
  return wrap == TextureWrap::kRepeat ? finite - std::floor(finite)
                                      : std::clamp(finite, -2.0f, 3.0f);
}

// Steps in uv for slopes. The smallest still leaves digits in the difference of two heights.
constexpr float kSlopeStepWithoutImage = 0.0005f, kSlopeStepMin = 0x1p-15f, kSlopeStepMax = 0.25f;

int Modulo(int a, int n) {
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

Vec2f TextureProgram::SlopeStep(const FloatOperand& operand) const {
  Vec2f step{kSlopeStepWithoutImage, kSlopeStepWithoutImage};
  bool found = false;
  std::vector<int32_t> open;
  if (operand.texture != kNone) open.push_back(operand.texture);
  // Nesting is bounded by kEvaluationsMax.
  while (!open.empty()) {
    const Node& node = nodes_[static_cast<size_t>(open.back())];
    open.pop_back();
    if (node.kind == Kind::kImage && node.mapping == UvMapping::Kind::kUv) {
      const Mapping& m = mappings_[static_cast<size_t>(node.mapping_index)];
      const Vec2f texel{0.5f / std::fabs(m.scale_u * static_cast<float>(node.image.width)),
                        0.5f / std::fabs(m.scale_v * static_cast<float>(node.image.height))};
      step = found ? Vec2f{std::fmin(step.x, texel.x), std::fmin(step.y, texel.y)} : texel;
      found = true;
    }
    for (const FloatOperand& child : {node.value[0], node.value[1], node.amount}) {
      if (child.texture != kNone) open.push_back(child.texture);
    }
  }
  return {std::clamp(step.x, kSlopeStepMin, kSlopeStepMax),
          std::clamp(step.y, kSlopeStepMin, kSlopeStepMax)};
}

// Source of the mappings: pbrt-v4, sec. 10.2 ("Texture Coordinate Generation").
Vec2f TextureProgram::MapTo2d(const Node& node, const TexturePoint& point) const {
  const Mapping& m = mappings_[static_cast<size_t>(node.mapping_index)];
  if (node.mapping == UvMapping::Kind::kUv) {
    const Vec2f uv{m.scale_u * point.uv.x + m.offset_u, m.scale_v * point.uv.y + m.offset_v};
    if (m.turn_u == 0 && m.turn_v == 0) return uv;
    return uv + Vec2f{m.turn_u * point.uv.y, m.turn_v * point.uv.x};
  }
  const Vec3f p = Vec3f{Dot(m.rows[0], point.p_world), Dot(m.rows[1], point.p_world),
                        Dot(m.rows[2], point.p_world)} +
                  m.origin;
  const auto inv_pi = static_cast<float>(1 / kPi);
  switch (node.mapping) {
    case UvMapping::Kind::kPlanar:
      return {m.offset_u + Dot(p, m.planar_u), m.offset_v + Dot(p, m.planar_v)};
    case UvMapping::Kind::kSpherical: {
      // atan2 instead of acos keeps the precision at the poles.
      const float theta = Atan2(std::sqrt(p.x * p.x + p.y * p.y), p.z);
      const float phi = Atan2(p.y, p.x);
      return {theta * inv_pi, (phi < 0 ? phi * 0.5f * inv_pi + 1 : phi * 0.5f * inv_pi)};
    }
    case UvMapping::Kind::kCylindrical:
      return {0.5f + Atan2(p.y, p.x) * 0.5f * inv_pi, p.z};
    case UvMapping::Kind::kUv:
      break;
  }
  return point.uv;
}

bool TextureProgram::IsOddCell(const Node& node, const TexturePoint& point) const {
  const auto cell = [](float x) { return static_cast<int32_t>(std::floor(Sanitize(x))); };
  if (node.kind == Kind::kCheckerboard2) {
    const Vec2f st = MapTo2d(node, point);
    return ((cell(st.x) + cell(st.y)) & 1) != 0;
  }
  const Mapping& m = mappings_[static_cast<size_t>(node.mapping_index)];
  int32_t sum = 0;
  for (size_t axis = 0; axis < 3; ++axis) {
    sum += cell(Dot(m.rows[axis], point.p_world) + m.origin[axis]);
  }
  return (sum & 1) != 0;
}

Texel TextureProgram::LookUp(const Node& node, const TexturePoint& point) const {
  const Vec2f st = MapTo2d(node, point);
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

template <typename Color>
Color TextureProgram::Evaluate(int32_t texture, const TexturePoint& point,
                               const WavelengthsOf<Color>& wavelengths) const {
  const Node& node = nodes_[static_cast<size_t>(texture)];
  const auto value = [&](size_t i) { return Value<Color>(node.color[i], point, wavelengths); };
  switch (node.kind) {
    case Kind::kConstant:
      return value(0);
    case Kind::kImage: {
      const Texel texel = LookUp(node, point);
      Rgb color =
          node.image.channels == 1 ? Rgb::Gray(texel[0]) : Rgb{texel[0], texel[1], texel[2]};
      color *= node.tint * node.scale;
      if (node.invert) color = Rgb::Gray(1) - color;
      // This form keeps NaN, so that a failed read is noticed.
      for (size_t c = 0; c < 3; ++c) color[c] = color[c] < 0 ? 0 : color[c];
      return ColorOfRgb<Color>(color, node.role, wavelengths);
    }
    case Kind::kCheckerboard2:
    case Kind::kCheckerboard3:
      return value(IsOddCell(node, point) ? 1 : 0);
    case Kind::kScale:
      return value(0) * Float(node.amount, point);
    case Kind::kMix: {
      const float amount = Float(node.amount, point);
      return value(0) * (1 - amount) + value(1) * amount;
    }
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
  }
  return 0;
}

}  // namespace sheaf::render
