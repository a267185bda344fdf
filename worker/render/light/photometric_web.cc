// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light/photometric_web.h"

#include <algorithm>
#include <cmath>

#include "common/base/check.h"
#include "common/math/elementary.h"

namespace sheaf::render {
namespace {

constexpr double kDegrees = kPi / 180;  // Radians per degree.

float Lerp(float a, float b, float t) { return (1 - t) * a + t * b; }

}  // namespace

PhotometricWeb::PhotometricWeb(const CandelaTable& table) : table_(table) {
  const std::vector<float>& planes = table_.horizontal_degrees;
  SHEAF_CHECK(!planes.empty() && table_.vertical_degrees.size() >= 2);
  SHEAF_CHECK(table_.candelas.size() == planes.size() * table_.vertical_degrees.size());
  peak_ = *std::max_element(table_.candelas.begin(), table_.candelas.end());
  if (planes.size() == 1) {
    mean_ = MeanOfPlane(0);
    return;
  }
  // Each plane represents half of the two gaps beside it.
  for (size_t i = 0; i < planes.size(); ++i) {
    const double before = static_cast<double>(planes[i > 0 ? i - 1 : planes.size() - 1]);
    const double after = static_cast<double>(planes[i + 1 < planes.size() ? i + 1 : 0]);
    const double gaps = after - before + (i == 0 || i + 1 == planes.size() ? 360 : 0);
    mean_ += MeanOfPlane(i) * gaps / 720;
  }
}

// Closed form of the integral of a piecewise linear function of the angle times the sine.
double PhotometricWeb::MeanOfPlane(size_t plane) const {
  const std::vector<float>& angles = table_.vertical_degrees;
  const float* c = &table_.candelas[plane * angles.size()];
  double sum = 0;
  for (size_t i = 0; i + 1 < angles.size(); ++i) {
    const double begin = static_cast<double>(angles[i]) * kDegrees;
    const double end = static_cast<double>(angles[i + 1]) * kDegrees;
    const double c_begin = static_cast<double>(c[i]), c_end = static_cast<double>(c[i + 1]);
    const SinCosPair<double> p = SinCos(begin), q = SinCos(end);
    sum += c_begin * p.cos - c_end * q.cos + (c_end - c_begin) / (end - begin) * (q.sin - p.sin);
  }
  return 0.5 * sum;
}

float PhotometricWeb::InPlane(size_t plane, size_t vertical, float t) const {
  const float* c = &table_.candelas[plane * table_.vertical_degrees.size() + vertical];
  return Lerp(c[0], c[1], t);
}

float PhotometricWeb::At(Vec3f d) const {
  const std::vector<float>& angles = table_.vertical_degrees;
  const double x = static_cast<double>(d.x), y = static_cast<double>(d.y);
  const auto vertical = static_cast<float>(
      Atan2(std::sqrt(x * x + y * y), static_cast<double>(-d.z)) * (1 / kDegrees));
  if (!(vertical >= angles.front() && vertical <= angles.back())) return 0;
  const auto above = std::upper_bound(angles.begin() + 1, angles.end() - 1, vertical);
  const auto v = static_cast<size_t>(above - angles.begin()) - 1;
  const float t = (vertical - angles[v]) / (angles[v + 1] - angles[v]);
  const std::vector<float>& planes = table_.horizontal_degrees;
  if (planes.size() == 1) return InPlane(0, v, t);
  auto horizontal = static_cast<float>(Atan2(y, x) * (1 / kDegrees));
  if (horizontal < 0) horizontal += 360;
  // The gap across 360 degrees lies before the first plane and after the last one.
  const auto after = std::upper_bound(planes.begin(), planes.end(), horizontal);
  const size_t last = planes.size() - 1;
  const size_t a = after == planes.begin() ? last : static_cast<size_t>(after - planes.begin()) - 1;
  const size_t b = a == last ? 0 : a + 1;
  const float gap = planes[b] - planes[a] + (a == last ? 360.f : 0.f);
  const float into = horizontal - planes[a] + (after == planes.begin() ? 360.f : 0.f);
  return Lerp(InPlane(a, v, t), InPlane(b, v, t), std::min(into / gap, 1.f));
}

}  // namespace sheaf::render
