// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/error/flip.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstddef>
#include <thread>

#include "common/base/check.h"
#include "common/film/error/line_filter.h"
#include "common/film/image_color.h"
#include "common/math/elementary.h"
#include "common/math/transform.h"

namespace sheaf {
namespace {

// Rows that one thread processes at a time; the rows around them are filtered again.
constexpr int32_t kBandRows = 128;
constexpr int kThreadsMax = 16;

// NaN becomes 0.
inline float Clamp01(float x) { return x > 0 ? (x < 1 ? x : 1.0f) : 0.0f; }

// ---- Color.

// Tristimulus values are divided by white's, so that white is (1, 1, 1).
struct ColorConstants {
  std::array<std::array<float, 3>, 3> xyz_from_rgb{}, rgb_from_xyz{};
};
ColorConstants MakeColorConstants() {
  const Matrix4 xyz_from_rgb = *XyzFromRgb(Chromaticities());
  const Vec3d white = TransformVector(xyz_from_rgb, {1, 1, 1});
  Matrix4 relative;
  for (size_t i = 0; i < 3; ++i) {
    for (size_t j = 0; j < 3; ++j) relative.m[i][j] = xyz_from_rgb.m[i][j] / white[i];
  }
  Matrix4 inverse;
  SHEAF_CHECK(Invert(relative, &inverse));
  ColorConstants constants;
  for (size_t i = 0; i < 3; ++i) {
    for (size_t j = 0; j < 3; ++j) {
      constants.xyz_from_rgb[i][j] = static_cast<float>(relative.m[i][j]);
      constants.rgb_from_xyz[i][j] = static_cast<float>(inverse.m[i][j]);
    }
  }
  return constants;
}

// For [0, 1], to float precision: two Halley steps from an initial guess by the exponent.
inline float CubeRoot(float x) {
  float y = std::bit_cast<float>(std::bit_cast<int32_t>(x) / 3 + 0x2a514067);
  for (int i = 0; i < 2; ++i) {
    const float cube = y * y * y;
    y = y * (cube + 2 * x) / (2 * cube + x);
  }
  return y;
}

// CIE 1976 L*a*b* with the Hunt effect (sec. 4.1.3), of tristimulus values relative to white.
struct HuntLab {
  float l = 0, a = 0, b = 0;
};
inline float LabCurve(float t) {
  constexpr float kDelta = 6.0f / 29;
  const float root = CubeRoot(t);
  return t > kDelta * kDelta * kDelta ? root : t / (3 * kDelta * kDelta) + 4.0f / 29;
}
inline HuntLab ToHuntLab(float x, float y, float z) {
  const float fx = LabCurve(x), fy = LabCurve(y), fz = LabCurve(z);
  const float l = 116 * fy - 16;
  return {l, 0.01f * l * 500 * (fx - fy), 0.01f * l * 200 * (fy - fz)};
}

// The distance HyAB (eq. 3).
inline float HyAb(const HuntLab& p, const HuntLab& q) {
  const float a = p.a - q.a, b = p.b - q.b;
  return std::fabs(p.l - q.l) + std::sqrt(a * a + b * b);
}

HuntLab HuntLabOfRgb(const ColorConstants& constants, const std::array<float, 3>& rgb) {
  std::array<float, 3> xyz{};
  for (size_t i = 0; i < 3; ++i) {
    for (size_t j = 0; j < 3; ++j) xyz[i] += constants.xyz_from_rgb[i][j] * rgb[j];
  }
  return ToHuntLab(xyz[0], xyz[1], xyz[2]);
}

// ---- Values common to all pixels.

constexpr double kColorExponent = 0.7, kFeatureExponent = 0.5;  // q_c, q_f.
constexpr float kKneeFraction = 0.4f, kKneeValue = 0.95f;       // p_c, p_t (eq. 4).

// A line is filtered along x by each of these, then by others along y.
enum Line : size_t {
  kLuma,
  kRedGreen,
  kBlueYellow1,
  kBlueYellow2,
  kSmooth,
  kEdge,
  kPoint,
  kLineCount
};

struct Constants {
  explicit Constants(double pixels_per_degree);
  // Filters of contrast sensitivity, sums of Gaussians (sec. 4.1.1, table 1): along x, and along y
  // with the amplitude of each.
  std::array<LineKernel, 4> sensitivity_x, sensitivity_y;
  LineKernel smooth, edge, point;  // Filters of the detectors (sec. 4.2.1).
  int32_t radius_max = 0;
  ColorConstants color;
  float color_max = 0;  // The maximum color difference: between green and blue.
};

Constants::Constants(double pixels_per_degree) : color(MakeColorConstants()) {
  // a sqrt(pi / b) exp(-(pi x)^2 / b), x in degrees; blue-yellow is the sum of two.
  struct Gaussian {
    double a, b;
  };
  constexpr std::array<Gaussian, 4> kGaussians{
      {{1, 0.0047}, {1, 0.0053}, {34.1, 0.04}, {13.5, 0.025}}};
  const auto deviation = [&](double b) { return std::sqrt(b / 2) / kPi * pixels_per_degree; };
  const auto radius = static_cast<int32_t>(std::ceil(3 * deviation(0.04)));
  std::array<double, 4> fraction{1, 1, 0, 0};
  for (size_t i = 2; i < 4; ++i) {
    double sum = 0;
    for (int32_t x = -radius; x <= radius; ++x) {
      const double d = x / deviation(kGaussians[i].b);
      sum += Exp(-0.5 * d * d);
    }
    fraction[i] = kGaussians[i].a * std::sqrt(kPi / kGaussians[i].b) * sum * sum;
  }
  const double both = fraction[2] + fraction[3];
  fraction[2] /= both;
  fraction[3] /= both;
  for (size_t i = 0; i < 4; ++i) {
    sensitivity_x[i] = GaussKernel(deviation(kGaussians[i].b), radius, 1);
    sensitivity_y[i] = GaussKernel(deviation(kGaussians[i].b), radius, fraction[i]);
  }
  constexpr double kFeatureWidthDegrees = 0.082;
  const double feature_deviation = 0.5 * kFeatureWidthDegrees * pixels_per_degree;
  const auto feature_radius = static_cast<int32_t>(std::ceil(3 * feature_deviation));
  std::vector<double> first, second;  // Derivatives of a Gaussian.
  for (int32_t x = 0; x <= feature_radius; ++x) {
    const double square = x * x / (feature_deviation * feature_deviation);
    first.push_back(x * Exp(-0.5 * square));
    second.push_back((square - 1) * Exp(-0.5 * square));
  }
  smooth = GaussKernel(feature_deviation, feature_radius, 1);
  edge = BalancedKernel(first, /*odd=*/true);
  point = BalancedKernel(second, /*odd=*/false);
  radius_max = std::max(radius, feature_radius);
  color_max = Pow(HyAb(HuntLabOfRgb(color, {0, 1, 0}), HuntLabOfRgb(color, {0, 0, 1})),
                  static_cast<float>(kColorExponent));
}

// ---- One image, line by line.

// The compared features of one line.
struct FeatureLine {
  std::vector<HuntLab> color;
  std::vector<float> edge, point;  // Their strengths.
};

class LineSource {
 public:
  LineSource(const Constants& constants, const FlipImage& image)
      : constants_(constants),
        image_(image),
        ring_rows_(2 * constants.radius_max + 1),
        padded_(static_cast<size_t>(image.width_px + 2 * constants.radius_max)),
        ring_(static_cast<size_t>(ring_rows_)),
        filtered_(8, std::vector<float>(static_cast<size_t>(image.width_px))) {
    for (auto& row : ring_) {
      for (std::vector<float>& line : row) line.resize(static_cast<size_t>(image.width_px));
    }
  }

  // Requires: y ascends from call to call, by one.
  void Develop(int32_t y, FeatureLine* line) {
    const int32_t last = std::min(y + constants_.radius_max, image_.height_px - 1);
    if (next_row_ < 0) next_row_ = std::max(y - constants_.radius_max, 0);
    for (; next_row_ <= last; ++next_row_) FilterAlongX(next_row_);
    FilterAlongY(y);
    const auto width = static_cast<size_t>(image_.width_px);
    line->color.resize(width);
    line->edge.resize(width);
    line->point.resize(width);
    for (size_t x = 0; x < width; ++x) line->color[x] = ColorAt(x);
    for (size_t x = 0; x < width; ++x) {
      const float ex = filtered_[4][x], ey = filtered_[5][x];
      const float px = filtered_[6][x], py = filtered_[7][x];
      line->edge[x] = std::sqrt(ex * ex + ey * ey);
      line->point[x] = std::sqrt(px * px + py * py);
    }
  }

 private:
  // Filters a row's Y, X - Y and Y - Z relative to white, with its end values repeated beyond it,
  // through each filter. These are YCxCz (eq. 1) but for factors, which linear filters preserve.
  void FilterAlongX(int32_t y) {
    auto& row = ring_[static_cast<size_t>(y % ring_rows_)];
    const auto& m = constants_.color.xyz_from_rgb;
    const auto width = static_cast<size_t>(image_.width_px);
    const auto radius = static_cast<size_t>(constants_.radius_max);
    const size_t start = static_cast<size_t>(y) * width;
    const auto pad = [&](size_t plus, size_t minus) {
      for (size_t x = 0; x < width; ++x) {
        const float r = Clamp01(image_.rgb[0][start + x]);
        const float g = Clamp01(image_.rgb[1][start + x]);
        const float b = Clamp01(image_.rgb[2][start + x]);
        float value = m[plus][0] * r + m[plus][1] * g + m[plus][2] * b;
        if (plus != minus) value -= m[minus][0] * r + m[minus][1] * g + m[minus][2] * b;
        padded_[radius + x] = value;
      }
      std::fill_n(padded_.begin(), radius, padded_[radius]);
      std::fill_n(padded_.end() - static_cast<std::ptrdiff_t>(radius), radius,
                  padded_[radius + width - 1]);
    };
    const auto line_at = [&](int32_t offset) {
      return padded_.data() + constants_.radius_max + offset;
    };
    const int32_t count = image_.width_px;
    pad(1, 1);
    FilterLine<false>(constants_.sensitivity_x[0], count, line_at, row[kLuma].data());
    FilterLine<false>(constants_.smooth, count, line_at, row[kSmooth].data());
    FilterLine<true>(constants_.edge, count, line_at, row[kEdge].data());
    FilterLine<false>(constants_.point, count, line_at, row[kPoint].data());
    pad(0, 1);
    FilterLine<false>(constants_.sensitivity_x[1], count, line_at, row[kRedGreen].data());
    pad(1, 2);
    FilterLine<false>(constants_.sensitivity_x[2], count, line_at, row[kBlueYellow1].data());
    FilterLine<false>(constants_.sensitivity_x[3], count, line_at, row[kBlueYellow2].data());
  }

  void FilterAlongY(int32_t y) {
    const auto lines = [&](Line line) {
      return [this, y, line](int32_t offset) -> const float* {
        const int32_t row = std::clamp(y + offset, 0, image_.height_px - 1);
        return ring_[static_cast<size_t>(row % ring_rows_)][line].data();
      };
    };
    const int32_t width = image_.width_px;
    for (size_t i = 0; i < 4; ++i) {
      FilterLine<false>(constants_.sensitivity_y[i], width, lines(static_cast<Line>(i)),
                        filtered_[i].data());
    }
    FilterLine<false>(constants_.smooth, width, lines(kEdge), filtered_[4].data());
    FilterLine<true>(constants_.edge, width, lines(kSmooth), filtered_[5].data());
    FilterLine<false>(constants_.smooth, width, lines(kPoint), filtered_[6].data());
    FilterLine<false>(constants_.point, width, lines(kSmooth), filtered_[7].data());
  }

  // Clipped to the screen's range before conversion to L*a*b* (sec. 4.1.1).
  HuntLab ColorAt(size_t i) const {
    const float y = filtered_[0][i];
    const std::array<float, 3> seen{y + filtered_[1][i], y,
                                    y - (filtered_[2][i] + filtered_[3][i])};
    const auto& to_rgb = constants_.color.rgb_from_xyz;
    const auto& to_xyz = constants_.color.xyz_from_rgb;
    std::array<float, 3> rgb{}, xyz{};
    for (size_t j = 0; j < 3; ++j) {
      rgb[j] = Clamp01(to_rgb[j][0] * seen[0] + to_rgb[j][1] * seen[1] + to_rgb[j][2] * seen[2]);
    }
    for (size_t j = 0; j < 3; ++j) {
      xyz[j] = to_xyz[j][0] * rgb[0] + to_xyz[j][1] * rgb[1] + to_xyz[j][2] * rgb[2];
    }
    return ToHuntLab(xyz[0], xyz[1], xyz[2]);
  }

  const Constants& constants_;
  const FlipImage& image_;
  const int32_t ring_rows_;
  int32_t next_row_ = -1;  // The first row not yet filtered along x.
  std::vector<float> padded_;
  std::vector<std::array<std::vector<float>, kLineCount>> ring_;
  std::vector<std::vector<float>> filtered_;
};

// Color errors, mapped to [0, 1] (eq. 4), raised to a power that depends on the features (eq. 7).
void CompareLines(const Constants& constants, const FeatureLine& reference,
                  const FeatureLine& image, float* out) {
  const float knee = kKneeFraction * constants.color_max;
  for (size_t x = 0; x < reference.color.size(); ++x) {
    const float distance = HyAb(reference.color[x], image.color[x]);
    const float color = Pow(distance, static_cast<float>(kColorExponent));
    const float spread = color < knee ? kKneeValue / knee * color
                                      : kKneeValue + (color - knee) / (constants.color_max - knee) *
                                                         (1 - kKneeValue);
    const float feature = std::max(std::fabs(reference.edge[x] - image.edge[x]),
                                   std::fabs(reference.point[x] - image.point[x]));
    static_assert(kFeatureExponent == 0.5);
    const float exponent = 1 - std::sqrt(feature * 0.70710678f);
    out[x] = spread > 0 ? Pow(spread, exponent) : 0;
  }
}

}  // namespace

std::vector<float> FlipMap(const FlipImage& reference, const FlipImage& image,
                           double pixels_per_degree) {
  SHEAF_CHECK(reference.width_px == image.width_px && reference.height_px == image.height_px);
  SHEAF_CHECK(reference.width_px > 0 && reference.height_px > 0);
  const Constants constants(pixels_per_degree);
  const auto width = static_cast<size_t>(reference.width_px);
  std::vector<float> map(width * static_cast<size_t>(reference.height_px));
  std::atomic<int32_t> next_row{0};
  const auto work = [&] {
    FeatureLine of_reference, of_image;
    for (int32_t first = next_row.fetch_add(kBandRows); first < reference.height_px;
         first = next_row.fetch_add(kBandRows)) {
      LineSource references(constants, reference), images(constants, image);
      const int32_t end = std::min(first + kBandRows, reference.height_px);
      for (int32_t y = first; y < end; ++y) {
        references.Develop(y, &of_reference);
        images.Develop(y, &of_image);
        CompareLines(constants, of_reference, of_image, &map[static_cast<size_t>(y) * width]);
      }
    }
  };
  const int32_t band_count = (reference.height_px + kBandRows - 1) / kBandRows;
  const int thread_count = std::min({static_cast<int>(std::thread::hardware_concurrency()),
                                     kThreadsMax, static_cast<int>(band_count)});
  std::vector<std::jthread> threads;
  for (int i = 1; i < thread_count; ++i) threads.emplace_back(work);
  work();
  threads.clear();
  return map;
}

double MeanFlip(const FlipImage& reference, const FlipImage& image, double pixels_per_degree) {
  double sum = 0;
  const std::vector<float> map = FlipMap(reference, image, pixels_per_degree);
  for (const float value : map) sum += double{value};
  return sum / static_cast<double>(map.size());
}

}  // namespace sheaf
