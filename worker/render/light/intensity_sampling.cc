// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light/intensity_sampling.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "common/math/elementary.h"
#include "common/math/frame.h"
#include "worker/render/sampling/equal_area_map.h"

namespace sheaf::render {
namespace {

// Largest extent of a web's parts. The intensity is nearly constant within them.
constexpr double kPartDegreesMax = 5;

// A part chosen with u, and where in the part's interval u lies, in [0, 1).
struct Choice {
  size_t index = 0;
  double along = 0;
};
Choice Choose(const DiscreteDistribution& choice, Vec2f u) {
  const double extended = ExtendBits(u.x, SaltOf(u));
  const size_t index = choice.Sample(extended);
  const double along = (extended - choice.Begin(index)) / choice.Probability(index);
  return {index, std::clamp(along, 0.0, 1 - 0x1p-53)};
}

// Solves 2 t^3 - t^4 = v, the cumulative smooth step, by bisection; exact to 2^-40, and
// nondecreasing in v.
double InvertSmoothStep(double v) {
  double low = 0, high = 1;
  for (int i = 0; i < 40; ++i) {
    const double t = 0.5 * (low + high);
    (t * t * t * (2 - t) < v ? low : high) = t;
  }
  return 0.5 * (low + high);
}

// Unit vector at this 1 - cosine and angle about the axis.
Vec3d AboutAxis(Vec3d axis, double one_minus_cos, double phi) {
  const Frame frame = Frame::FromNormal(ToFloat(axis));
  const double sine = std::sqrt(one_minus_cos * (2 - one_minus_cos));
  const SinCosPair<double> turn = SinCos(phi);
  return Normalize((1 - one_minus_cos) * axis + (sine * turn.cos) * ToDouble(frame.t) +
                   (sine * turn.sin) * ToDouble(frame.b));
}

// Cuts the intervals between the edges, in degrees, into equal parts; in radians.
std::vector<double> Subdivide(const std::vector<double>& edges_degrees) {
  std::vector<double> edges;
  for (size_t i = 0; i + 1 < edges_degrees.size(); ++i) {
    const double begin = edges_degrees[i], size = edges_degrees[i + 1] - begin;
    const double parts = std::max(1.0, std::ceil(size / kPartDegreesMax));
    for (double k = 0; k < parts; ++k) edges.push_back((begin + size * (k / parts)) * (kPi / 180));
  }
  edges.push_back(edges_degrees.back() * (kPi / 180));
  return edges;
}

// The interval that contains v; the nearest one outside.
size_t IntervalAt(const std::vector<double>& edges, double v) {
  const auto above = std::upper_bound(edges.begin() + 1, edges.end() - 1, v);
  return static_cast<size_t>(above - edges.begin()) - 1;
}

// The direction of a web's angles, in its space.
Vec3d WebDirection(double cos_nadir, double phi) {
  const double sine = std::sqrt(std::max(0.0, 1 - cos_nadir * cos_nadir));
  const SinCosPair<double> turn = SinCos(phi);
  return {sine * turn.cos, sine * turn.sin, -cos_nadir};
}

}  // namespace

// --- Spots -------------------------------------------------------------------------------------

// The mean of the smooth step over its range of cosines is exactly one half.
double SpotDirections::Integral() const {
  return 2 * kPi * ((1 - cos_start_) + 0.5 * (cos_start_ - cos_end_));
}

Vec3d SpotDirections::Sample(Vec2f u) const {
  const double even = 1 - cos_start_, edge = 0.5 * (cos_start_ - cos_end_);
  const double v = static_cast<double>(u.x) * (even + edge);
  const double one_minus_cos =
      v < even ? v : even + (1 - InvertSmoothStep((even + edge - v) / edge)) * 2 * edge;
  return AboutAxis(axis_, one_minus_cos, 2 * kPi * static_cast<double>(u.y));
}

double SpotDirections::Pdf(Vec3d d) const {
  const double cosine = Dot(d, axis_);
  if (!(cosine > cos_end_)) return 0;
  if (cosine >= cos_start_) return 1 / Integral();
  const double t = (cosine - cos_end_) / (cos_start_ - cos_end_);
  return t * t * (3 - 2 * t) / Integral();
}

// --- Maps --------------------------------------------------------------------------------------

MapDirections::MapDirections(const IntensityMap& map)
    : map_(&map), choice_(std::vector<double>(map.texels().begin(), map.texels().end())) {}

Vec3d MapDirections::Sample(Vec2f u) const {
  const Choice texel = Choose(choice_, u);
  const auto size = static_cast<size_t>(map_->size());
  const double side = map_->size();
  return EqualAreaSquareToSphere(
      {(static_cast<double>(texel.index % size) + texel.along) / side,
       (static_cast<double>(texel.index / size) + static_cast<double>(u.y)) / side});
}

double MapDirections::Pdf(Vec3f d) const {
  return static_cast<double>(map_->At(d)) / (4 * kPi * map_->mean());
}

// --- Luminaires --------------------------------------------------------------------------------

WebDirections::WebDirections(const PhotometricWeb& web) {
  const CandelaTable& table = web.table();
  vertical_ = Subdivide({table.vertical_degrees.begin(), table.vertical_degrees.end()});
  std::vector<double> turn(table.horizontal_degrees.begin(), table.horizontal_degrees.end());
  turn.push_back(turn.front() + 360);
  horizontal_ = Subdivide(turn);
  std::vector<double> weights;
  for (size_t v = 0; v + 1 < vertical_.size(); ++v) {
    for (size_t h = 0; h + 1 < horizontal_.size(); ++h) {
      // A bilinear function that is positive anywhere in the part is positive at these points.
      double sum = 0;
      for (const double s : {0.25, 0.75}) {
        for (const double t : {0.25, 0.75}) {
          const double nadir = vertical_[v] + s * (vertical_[v + 1] - vertical_[v]);
          const double phi = horizontal_[h] + t * (horizontal_[h + 1] - horizontal_[h]);
          sum += static_cast<double>(web.At(ToFloat(WebDirection(Cos(nadir), phi))));
        }
      }
      weights.push_back(0.25 * sum * SolidAngle(v, h));
    }
  }
  choice_ = DiscreteDistribution(weights);
}

double WebDirections::SolidAngle(size_t vertical, size_t horizontal) const {
  // cos a - cos b, without cancellation.
  const double middle = 0.5 * (vertical_[vertical] + vertical_[vertical + 1]);
  const double half = 0.5 * (vertical_[vertical + 1] - vertical_[vertical]);
  return 2 * Sin(middle) * Sin(half) * (horizontal_[horizontal + 1] - horizontal_[horizontal]);
}

Vec3d WebDirections::Sample(Vec2f u) const {
  const Choice part = Choose(choice_, u);
  const size_t across = horizontal_.size() - 1;
  const size_t v = part.index / across, h = part.index % across;
  const double cos_low = Cos(vertical_[v]), cos_high = Cos(vertical_[v + 1]);
  return WebDirection(cos_low + static_cast<double>(u.y) * (cos_high - cos_low),
                      horizontal_[h] + part.along * (horizontal_[h + 1] - horizontal_[h]));
}

double WebDirections::Pdf(Vec3f d) const {
  const double x = static_cast<double>(d.x), y = static_cast<double>(d.y);
  const double nadir = Atan2(std::sqrt(x * x + y * y), static_cast<double>(-d.z));
  if (!(nadir >= vertical_.front() && nadir <= vertical_.back())) return 0;
  double phi = Atan2(y, x);
  while (phi < horizontal_.front()) phi += 2 * kPi;
  const size_t v = IntervalAt(vertical_, nadir), h = IntervalAt(horizontal_, phi);
  return choice_.Probability(v * (horizontal_.size() - 1) + h) / SolidAngle(v, h);
}

// --- Projected images --------------------------------------------------------------------------

double ImageDirections::TexelArea() const {
  return (2 * image_->half_width() / image_->width()) *
         (2 * image_->half_height() / image_->height());
}

ImageDirections::ImageDirections(const ProjectedImage& image) : image_(&image) {
  std::vector<double> weights;
  for (int row = 0; row < image.height(); ++row) {
    for (int column = 0; column < image.width(); ++column) {
      const double x = image.half_width() * (2 * (column + 0.5) / image.width() - 1);
      const double y = image.half_height() * (2 * (row + 0.5) / image.height() - 1);
      const double square = 1 + x * x + y * y;
      const double luminance = static_cast<double>(Luminance(image.texel(weights.size())));
      weights.push_back(luminance / (square * std::sqrt(square)));
    }
  }
  choice_ = DiscreteDistribution(weights);
}

Vec3d ImageDirections::Sample(Vec2f u) const {
  const Choice texel = Choose(choice_, u);
  const auto width = static_cast<size_t>(image_->width());
  const double column = static_cast<double>(texel.index % width) + texel.along;
  const double row = static_cast<double>(texel.index / width) + static_cast<double>(u.y);
  return Normalize(Vec3d{image_->half_width() * (2 * column / image_->width() - 1),
                         image_->half_height() * (1 - 2 * row / image_->height()), 1});
}

double ImageDirections::Pdf(Vec3f d) const {
  const std::optional<size_t> texel = image_->TexelTowards(d);
  if (!texel) return 0;
  const double cosine = static_cast<double>(d.z) / Length(ToDouble(d));
  return choice_.Probability(*texel) / (TexelArea() * cosine * cosine * cosine);
}

}  // namespace sheaf::render
