// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/half_space.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "common/base/mutex.h"

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

constexpr size_t kPieceNodes = 28, kNodesMax = 2 * kPieceNodes;

// Midpoints, denser towards `low`, where the integrand has a square root.
struct Nodes {
  std::array<Node, kNodesMax> node;
  size_t count = 0;

  void Add(double low, double high, double eta) {
    constexpr int kCount = static_cast<int>(kPieceNodes);
    for (int i = 0; i < kCount; ++i) {
      const double t = (i + 0.5) / kCount;
      const double mu = low + (high - low) * t * t;
      node[count++] = {mu, (high - low) * 2 * t / kCount, Fresnel(mu, 1 / eta)};
    }
  }
};
using PerNode = std::array<double, kNodesMax>;

Nodes MakeNodes(double eta) {
  Nodes nodes;
  const double critical = eta > 1 ? std::sqrt(1 - 1 / (eta * eta)) : 0;
  if (critical > 0) nodes.Add(0, critical, eta);
  nodes.Add(critical, 1, eta);
  return nodes;
}

// Chandrasekhar's H at the nodes, by iterating the form of its equation that converges up to albedo
// 1.
PerNode MakeH(const Nodes& nodes, double albedo) {
  constexpr int kIterations = 200;
  constexpr double kTolerance = 1e-10;
  const double lost = std::sqrt(1 - albedo);
  const Node* const node = nodes.node.data();
  PerNode result;
  double* const h = result.data();
  std::fill_n(h, nodes.count, 1);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    double change = 0;
    for (size_t i = 0; i < nodes.count; ++i) {
      double sum = 0;
      for (size_t j = 0; j < nodes.count; ++j) {
        sum += node[j].weight * node[j].mu * h[j] / (node[i].mu + node[j].mu);
      }
      const double next = (h[i] + 1 / (lost + albedo / 2 * sum)) / 2;
      change = std::max(change, std::fabs(next - h[i]));
      h[i] = next;
    }
    if (change < kTolerance) break;
  }
  return result;
}

// HalfSpaceReflectance, which ends once its sum, of terms of 0 or more, is more than `enough`.
// Requires: 0 < albedo < 1.
double SumOrders(const Nodes& nodes, double albedo, double enough) {
  const PerNode values = MakeH(nodes, albedo);
  const Node* const node = nodes.node.data();
  const double* const h = values.data();
  constexpr int kOrdersMax = 2000;
  constexpr double kTolerance = 1e-9;
  // Downward light at the boundary, summed over the number of internal reflections.
  PerNode down_at, next_at;
  double* down = down_at.data();
  double* next = next_at.data();
  double entered = 0, left = 0;
  for (size_t i = 0; i < nodes.count; ++i) {
    down[i] = 1 - node[i].reflected;
    entered += down[i] * node[i].mu * node[i].weight;
  }
  for (int order = 0; order < kOrdersMax; ++order) {
    double kept = 0;
    for (size_t i = 0; i < nodes.count; ++i) {
      double up = 0;
      for (size_t j = 0; j < nodes.count; ++j) {
        up += node[j].weight * h[j] * node[j].mu / (node[i].mu + node[j].mu) * down[j];
      }
      up *= albedo / 2 * h[i];
      left += up * (1 - node[i].reflected) * node[i].mu * node[i].weight;
      next[i] = up * node[i].reflected;
      kept += next[i] * node[i].mu * node[i].weight;
    }
    if (kept < kTolerance * entered || left / entered > enough) break;
    std::swap(down, next);
  }
  return std::min(1.0, left / entered);
}

}  // namespace

double HalfSpaceReflectance(double albedo, double eta) {
  if (albedo <= 0) return 0;
  if (albedo >= 1) return 1;
  return SumOrders(MakeNodes(eta), albedo, std::numeric_limits<double>::infinity());
}

namespace {

// The similarity relation.
template <typename Float>
Float WithAsymmetry(Float isotropic, Float g) {
  return isotropic / (1 - g + isotropic * g);
}

// Bisects the square root of the absorbed fraction, in which the reflectance is nearly straight.
double SolveForLostRoot(double reflectance, double eta) {
  const Nodes nodes = MakeNodes(eta);
  double low = 0, high = 1;
  for (int step = 0; step < 30; ++step) {
    const double middle = (low + high) / 2;
    const double albedo = 1 - middle * middle;
    const bool reflects_more = albedo >= 1 || SumOrders(nodes, albedo, reflectance) > reflectance;
    (reflects_more ? low : high) = middle;
  }
  return low;
}

// A solution takes milliseconds, and scenes repeat few of them: gray has one for three channels,
// and a material may stand in a file for each of its shapes.
// Thread safety: any number of threads at once.
class LatestSolutions {
 public:
  std::optional<double> Find(double reflectance, double eta) const {
    const MutexLock lock(&mutex_);
    for (const Solution& known : solutions_) {
      if (known.reflectance == reflectance && known.eta == eta) return known.lost_root;
    }
    return std::nullopt;
  }
  void Add(double reflectance, double eta, double lost_root) {
    const MutexLock lock(&mutex_);
    solutions_[next_] = {reflectance, eta, lost_root};
    next_ = (next_ + 1) % solutions_.size();
  }

 private:
  struct Solution {
    double reflectance = 0;  // 0 needs no solution: the place is free.
    double eta = 0, lost_root = 0;
  };
  mutable Mutex mutex_;
  std::array<Solution, 256> solutions_ ABSL_GUARDED_BY(mutex_);
  size_t next_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace

double AlbedoForReflectance(double reflectance, double eta, double g) {
  if (!(reflectance > 0)) return 0;
  if (reflectance >= 1) return 1;
  static LatestSolutions latest;
  std::optional<double> lost_root = latest.Find(reflectance, eta);
  if (!lost_root.has_value()) {
    lost_root = SolveForLostRoot(reflectance, eta);
    latest.Add(reflectance, eta, *lost_root);
  }
  return WithAsymmetry(1 - *lost_root * *lost_root, g);
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
