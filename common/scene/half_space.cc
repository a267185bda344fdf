// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/half_space.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace sheaf {
namespace {

// Cosines inside the medium, with weights that add up to 1.
struct Node {
  double mu, weight;
  double reflected;  // Fresnel reflectance for light from inside.
};

// Unpolarized. eta: far side over near side.
double Fresnel(double cosine, double eta) {
  const double sine2 = (1 - cosine * cosine) / (eta * eta);
  if (sine2 >= 1) return 1;
  const double far_cosine = std::sqrt(1 - sine2);
  const double parallel = (eta * cosine - far_cosine) / (eta * cosine + far_cosine);
  const double perpendicular = (cosine - eta * far_cosine) / (cosine + eta * far_cosine);
  return (parallel * parallel + perpendicular * perpendicular) / 2;
}

// Midpoints, denser towards `low`, where the integrand has a square root.
void AddNodes(double low, double high, double eta, std::vector<Node>* nodes) {
  constexpr int kCount = 28;
  for (int i = 0; i < kCount; ++i) {
    const double t = (i + 0.5) / kCount;
    const double mu = low + (high - low) * t * t;
    nodes->push_back({mu, (high - low) * 2 * t / kCount, Fresnel(mu, 1 / eta)});
  }
}

std::vector<Node> MakeNodes(double eta) {
  std::vector<Node> nodes;
  const double critical = eta > 1 ? std::sqrt(1 - 1 / (eta * eta)) : 0;
  if (critical > 0) AddNodes(0, critical, eta, &nodes);
  AddNodes(critical, 1, eta, &nodes);
  return nodes;
}

// Chandrasekhar's H at the nodes, by iterating the form of its equation that converges up to albedo
// 1.
std::vector<double> MakeH(const std::vector<Node>& nodes, double albedo) {
  constexpr int kIterations = 200;
  constexpr double kTolerance = 1e-10;
  const double lost = std::sqrt(1 - albedo);
  std::vector<double> h(nodes.size(), 1);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    double change = 0;
    for (size_t i = 0; i < nodes.size(); ++i) {
      double sum = 0;
      for (size_t j = 0; j < nodes.size(); ++j) {
        sum += nodes[j].weight * nodes[j].mu * h[j] / (nodes[i].mu + nodes[j].mu);
      }
      const double next = (h[i] + 1 / (lost + albedo / 2 * sum)) / 2;
      change = std::max(change, std::fabs(next - h[i]));
      h[i] = next;
    }
    if (change < kTolerance) break;
  }
  return h;
}

}  // namespace

double HalfSpaceReflectance(double albedo, double eta) {
  if (albedo <= 0) return 0;
  if (albedo >= 1) return 1;
  const std::vector<Node> nodes = MakeNodes(eta);
  const std::vector<double> h = MakeH(nodes, albedo);
  constexpr int kOrdersMax = 2000;
  constexpr double kTolerance = 1e-9;
  // Downward light at the boundary, summed over the number of internal reflections.
  std::vector<double> down(nodes.size());
  double entered = 0, left = 0;
  for (size_t i = 0; i < nodes.size(); ++i) {
    down[i] = 1 - nodes[i].reflected;
    entered += down[i] * nodes[i].mu * nodes[i].weight;
  }
  for (int order = 0; order < kOrdersMax; ++order) {
    std::vector<double> next(nodes.size());
    double kept = 0;
    for (size_t i = 0; i < nodes.size(); ++i) {
      double up = 0;
      for (size_t j = 0; j < nodes.size(); ++j) {
        up += nodes[j].weight * h[j] * nodes[j].mu / (nodes[i].mu + nodes[j].mu) * down[j];
      }
      up *= albedo / 2 * h[i];
      left += up * (1 - nodes[i].reflected) * nodes[i].mu * nodes[i].weight;
      next[i] = up * nodes[i].reflected;
      kept += next[i] * nodes[i].mu * nodes[i].weight;
    }
    if (kept < kTolerance * entered) break;
    down = next;
  }
  return std::min(1.0, left / entered);
}

namespace {

// The similarity relation.
template <typename Float>
Float WithAsymmetry(Float isotropic, Float g) {
  return isotropic / (1 - g + isotropic * g);
}

}  // namespace

double AlbedoForReflectance(double reflectance, double eta, double g) {
  if (!(reflectance > 0)) return 0;
  if (reflectance >= 1) return 1;
  // Bisects the square root of the absorbed fraction, in which the reflectance is nearly straight.
  double low = 0, high = 1;
  for (int step = 0; step < 30; ++step) {
    const double middle = (low + high) / 2;
    (HalfSpaceReflectance(1 - middle * middle, eta) > reflectance ? low : high) = middle;
  }
  return WithAsymmetry(1 - low * low, g);
}

AlbedoCurve::AlbedoCurve(double eta, double g) : g_(static_cast<float>(g)) {
  // Tabulates reflectance by absorbed fraction, then inverts the table.
  constexpr size_t kKnown = 128;
  std::array<double, kKnown + 1> lost_root{}, reflected{};
  for (size_t i = 0; i <= kKnown; ++i) {
    // Denser where little is absorbed.
    lost_root[i] = std::pow(static_cast<double>(i) / kKnown, 2);
    reflected[i] = HalfSpaceReflectance(1 - lost_root[i] * lost_root[i], eta);
  }
  size_t i = kKnown;  // End of the interval that contains the reflectance.
  for (size_t step = 0; step <= kSteps; ++step) {
    const double reflectance = static_cast<double>(step) / kSteps;
    while (i > 1 && reflected[i - 1] < reflectance) --i;
    const double t = (reflected[i - 1] - reflectance) / (reflected[i - 1] - reflected[i]);
    lost_root_[step] = static_cast<float>(lost_root[i - 1] + t * (lost_root[i] - lost_root[i - 1]));
  }
}

float AlbedoCurve::At(float reflectance) const {
  if (std::isnan(reflectance)) return reflectance;
  const float at = std::clamp(reflectance, 0.0f, 1.0f) * kSteps;
  const size_t below = std::min(static_cast<size_t>(at), kSteps - 1);
  const float t = at - static_cast<float>(below);
  const float lost_root = lost_root_[below] + t * (lost_root_[below + 1] - lost_root_[below]);
  return WithAsymmetry(1 - lost_root * lost_root, g_);
}

}  // namespace sheaf
