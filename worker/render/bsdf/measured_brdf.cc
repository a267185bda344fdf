// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/bsdf/measured_brdf.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "common/math/elementary.h"
#include "common/scene/spectrum/spectrum.h"

namespace sheaf::render {
namespace {

constexpr float kPiF = static_cast<float>(kPi);

// Maps angles to the unit square and back. Square roots give small theta more of it.
struct Angles {
  float theta = 0, phi = 0;  // phi in [-pi, pi].
};
Angles AnglesOf(Vec3f w) {
  // arc cosine would lose small angles.
  return {Atan2(std::sqrt(w.x * w.x + w.y * w.y), w.z), Atan2(w.y, w.x)};
}
float SquareOfTheta(float theta) { return std::sqrt(theta * (2 / kPiF)); }
float SquareOfPhi(float phi) { return phi / (2 * kPiF) + 0.5f; }
float WrapUnit(float x) { return x - std::floor(x); }

// d(omega) / d(square) of micro-normals.
float NormalJacobian(float u_theta, float sin_theta) {
  return 2 * kPiF * kPiF * u_theta * sin_theta;
}

// Weights of the values at wavelengths in linear sRGB under D65: integrals of the hat functions of
// the piecewise linear interpolation. Values are constant beyond the ends.
std::vector<std::array<float, 3>> RgbWeights(const std::vector<float>& wavelengths) {
  std::vector<std::array<double, 3>> weights(wavelengths.size(), {0, 0, 0});
  std::array<double, 3> white{};
  for (size_t i = 0; i < kSpectrumCount; ++i) {
    const double nm = kSpectrumFirstNm + static_cast<double>(i);
    const std::array<double, 3> observer = ObserverRgb(nm);
    const AxisPosition at = FindOnAxis(wavelengths, static_cast<float>(nm));
    const auto fraction = static_cast<double>(at.fraction);
    for (size_t c = 0; c < 3; ++c) {
      const double contribution = observer[c] * UnitD65(nm);
      white[c] += contribution;
      weights[at.index][c] += (1 - fraction) * contribution;
      if (fraction > 0) weights[at.index + 1][c] += fraction * contribution;
    }
  }
  std::vector<std::array<float, 3>> result(weights.size());
  for (size_t i = 0; i < weights.size(); ++i) {
    // Makes white exact, without the rounding of the sum.
    for (size_t c = 0; c < 3; ++c) result[i][c] = static_cast<float>(weights[i][c] / white[c]);
  }
  return result;
}

}  // namespace

MeasuredBrdf::MeasuredBrdf(MeasuredData data, bool spectral)
    : is_isotropic_(data.shape.IsIsotropic()),
      has_jacobian_(data.has_jacobian),
      spectra_size_(data.shape.spectra_size),
      phi_(std::move(data.phi)),
      theta_(std::move(data.theta)),
      wavelengths_(std::move(data.wavelengths)),
      ndf_(data.shape.ndf_width, data.shape.ndf_height, std::move(data.ndf)),
      sigma_(data.shape.sigma_width, data.shape.sigma_height, std::move(data.sigma)),
      vndf_(data.shape.vndf_width, data.shape.vndf_height, std::move(data.vndf)),
      luminance_(spectra_size_, spectra_size_, std::move(data.luminance)) {
  MakeRgb(data.spectra);
  if (spectral) spectra_ = std::move(data.spectra);
  albedo_ = MeanReflection();
}

void MeasuredBrdf::MakeRgb(const std::vector<float>& spectra) {
  const std::vector<std::array<float, 3>> weights = RgbWeights(wavelengths_);
  const size_t plane = static_cast<size_t>(spectra_size_) * spectra_size_;
  const size_t slices = phi_.size() * theta_.size(), count = wavelengths_.size();
  rgb_.assign(slices * 3 * plane, 0);
  for (size_t s = 0; s < slices; ++s) {
    for (size_t w = 0; w < count; ++w) {
      const float* from = &spectra[(s * count + w) * plane];
      for (size_t c = 0; c < 3; ++c) {
        float* to = &rgb_[(s * 3 + c) * plane];
        for (size_t i = 0; i < plane; ++i) to[i] += weights[w][c] * from[i];
      }
    }
  }
}

SliceBlend MeasuredBrdf::BlendFor(float phi, float theta) const {
  return BlendSlices(phi_, theta_, phi, theta);
}

float MeasuredBrdf::LookUp(const std::vector<float>& table, size_t channels, size_t channel,
                           const SliceBlend& blend, const CellPosition& cell) const {
  const size_t n = spectra_size_;
  const size_t at = static_cast<size_t>(cell.row) * n + cell.column;
  const float x = cell.at.x, y = cell.at.y;
  float sum = 0;
  for (size_t k = 0; k < blend.count; ++k) {
    const float* v = &table[(blend.slice[k] * channels + channel) * n * n + at];
    sum += blend.weight[k] *
           ((1 - y) * ((1 - x) * v[0] + x * v[1]) + y * ((1 - x) * v[n] + x * v[n + 1]));
  }
  return sum;
}

Rgb MeasuredBrdf::Reflected(const SliceBlend& blend, const CellPosition& cell, const Rgb&) const {
  return MakeColor<Rgb>([&](size_t c) { return std::fmax(LookUp(rgb_, 3, c, blend, cell), 0.0f); });
}

Spectral MeasuredBrdf::Reflected(const SliceBlend& blend, const CellPosition& cell,
                                 const Spectral& nm) const {
  return MakeColor<Spectral>([&](size_t c) {
    const AxisPosition at = FindOnAxis(wavelengths_, nm[c]);
    float value = LookUp(spectra_, wavelengths_.size(), at.index, blend, cell);
    if (at.fraction > 0) {
      const float next = LookUp(spectra_, wavelengths_.size(), at.index + 1, blend, cell);
      value += at.fraction * (next - value);
    }
    return std::fmax(value, 0.0f);
  });
}

template <typename Color>
MeasuredBrdf::Value<Color> MeasuredBrdf::Eval(Vec3f wo, Vec3f wi, const Color& nm) const {
  const Vec3f sum = wo + wi;
  const float length = Length(sum);
  if (!(length > 0)) return {};
  const Vec3f wm = sum * (1 / length);
  const Angles o = AnglesOf(wo), m = AnglesOf(wm);
  const Vec2f square_m{SquareOfTheta(m.theta),
                       WrapUnit(SquareOfPhi(is_isotropic_ ? m.phi - o.phi : m.phi))};
  const SliceBlend blend = BlendFor(o.phi, o.theta);
  const WarpTable::Point warped = vndf_.Invert(blend, square_m);
  if (!(warped.pdf > 0)) return {};
  Value<Color> value;
  value.f_cos = Reflected(blend, FindCell(spectra_size_, spectra_size_, warped.p), nm);
  if (has_jacobian_) {
    const float sigma = sigma_.At({SquareOfTheta(o.theta), SquareOfPhi(o.phi)});
    if (!(sigma > 0)) return {};
    value.f_cos *= ndf_.At(square_m) / (4 * sigma);
  }
  const float jacobian =
      4 * Dot(wo, wm) * NormalJacobian(square_m.x, std::sqrt(wm.x * wm.x + wm.y * wm.y));
  // The pole of the square, where the density is unbounded, has negligible measure.
  constexpr float kJacobianMin = 1e-12f;
  value.pdf = warped.pdf * luminance_.Pdf(blend, warped.p) / std::fmax(jacobian, kJacobianMin);
  return value;
}
template MeasuredBrdf::Value<Rgb> MeasuredBrdf::Eval(Vec3f, Vec3f, const Rgb&) const;
template MeasuredBrdf::Value<Spectral> MeasuredBrdf::Eval(Vec3f, Vec3f, const Spectral&) const;

std::optional<Vec3f> MeasuredBrdf::Sample(Vec3f wo, Vec2f u) const {
  const Angles o = AnglesOf(wo);
  const SliceBlend blend = BlendFor(o.phi, o.theta);
  const Vec2f square_m = vndf_.Sample(blend, luminance_.Sample(blend, u).p).p;
  const float theta = square_m.x * square_m.x * (kPiF / 2);
  const float phi = (2 * square_m.y - 1) * kPiF + (is_isotropic_ ? o.phi : 0);
  const SinCosPair<float> t = SinCos(theta), p = SinCos(phi);
  const Vec3f wm{t.sin * p.cos, t.sin * p.sin, t.cos};
  const float cos_m = Dot(wo, wm);
  const Vec3f wi = wm * (2 * cos_m) - wo;
  if (!(cos_m > 0 && wi.z > 0)) return std::nullopt;
  return Normalize(wi);
}

Rgb MeasuredBrdf::MeanReflection() const {
  constexpr int kSide = 32;
  const Vec3f wo{0, 0, 1};
  Rgb sum;
  for (int i = 0; i < kSide * kSide; ++i) {
    const Vec2f u{(static_cast<float>(i % kSide) + 0.5f) / kSide,
                  (static_cast<float>(i / kSide) + 0.5f) / kSide};
    const std::optional<Vec3f> wi = Sample(wo, u);
    if (!wi) continue;
    const Value<Rgb> value = Eval(wo, *wi, Rgb{});
    if (value.pdf > 0) sum += value.f_cos / value.pdf;
  }
  return sum / (kSide * kSide);
}

}  // namespace sheaf::render
