// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/guiding/emission_statistics.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <utility>

#include "common/base/vector_bytes.h"

namespace sheaf::render {

// Divides lights and boxes from the root down, and undoes from the leaves up what does not pay.
class EmissionFit {
 public:
  struct Path {
    uint32_t light = 0;
    std::array<double, kEmissionAxes> u{};
    double square = 0;  // f^2 over the density of paths: its sum is the integral of f^2.
  };

  EmissionFit(const LightEmission& emission, std::vector<Path> paths)
      : emission_(emission), paths_(std::move(paths)) {}

  EmissionField Run() {
    EmissionField field;
    field.light_count_ = emission_.choice_count();
    Box box;
    box.last = field.light_count_;
    box.measure = 1;
    const Sums sums = SumsOf(paths_);
    if (!(sums.square > 0)) return {};
    box.square = sums.square;
    least_gain_ = kEmissionLeastGain * WeightOf(box);
    Add(box, paths_);
    // Where there are too many cells, it costs more to divide one: all are treated alike.
    while (nodes_.size() / 2 + 1 > kEmissionCellsMax) {
      nodes_.clear();
      least_gain_ *= 2;
      Add(box, paths_);
    }
    field.nodes_ = std::move(nodes_);
    return field;
  }

 private:
  using Kind = EmissionField::Kind;
  struct Box {
    uint32_t first = 0, last = 0;
    std::array<double, kEmissionAxes> lower{0, 0, 0, 0}, size{1, 1, 1, 1};
    std::array<uint32_t, kEmissionAxes> halvings{};
    double measure = 0;  // The probability with which power alone would choose it.
    double square = 0;   // The integral of f^2, with what is known of the box about it.
  };
  struct Sums {
    double square = 0, square_of_squares = 0;
    // So many equal paths would be as uncertain.
    double Number() const {
      return square_of_squares > 0 ? square * square / square_of_squares : 0;
    }
  };
  // The cost of a part of the tree, and the sum of its cells' weights.
  struct Cost {
    double weight = 0, price = 0;
  };
  struct Division {
    Kind kind = Kind::kCell;
    uint32_t light = 0;
    double lower_measure = 0.5;  // As a fraction of the box's measure.
  };

  static Sums SumsOf(std::span<const Path> paths) {
    Sums sums;
    for (const Path& path : paths) {
      sums.square += path.square;
      sums.square_of_squares += path.square * path.square;
    }
    return sums;
  }
  static double WeightOf(const Box& box) { return std::sqrt(box.measure * box.square); }
  static size_t AxisOf(Kind kind) { return static_cast<size_t>(kind) - 1; }
  static bool IsUpper(const Division& division, const Box& box, const Path& path) {
    if (division.kind == Kind::kByLight) return path.light >= division.light;
    const size_t axis = AxisOf(division.kind);
    return path.u[axis] >= box.lower[axis] + 0.5 * box.size[axis];
  }

  // The sum of the parts' weights, by their paths alone.
  static double WeightOfHalves(const Box& box, const Division& division,
                               std::span<const Path> paths) {
    double lower = 0, upper = 0;
    for (const Path& path : paths) {
      (IsUpper(division, box, path) ? upper : lower) += path.square;
    }
    return std::sqrt(box.measure * division.lower_measure * lower) +
           std::sqrt(box.measure * (1 - division.lower_measure) * upper);
  }

  // Lights by the middle of their power; places along the axis that gains most. None where the box
  // cannot be divided.
  std::optional<Division> Divide(const Box& box, std::span<const Path> paths) const {
    if (box.last - box.first > 1) {
      const double begin = emission_.ChoiceBegin(box.first), end = emission_.ChoiceBegin(box.last);
      Division division{Kind::kByLight, emission_.Choose(std::min(0.5 * (begin + end), kPlaceMost)),
                        0};
      division.light = std::clamp(division.light, box.first + 1, box.last - 1);
      division.lower_measure = (emission_.ChoiceBegin(division.light) - begin) / (end - begin);
      return division;
    }
    const EmissionAxes axes = emission_.AxesOf(box.first);
    std::optional<Division> best;
    double least = 0;
    for (size_t axis = 0; axis < kEmissionAxes; ++axis) {
      if (!axes.Has(axis) || box.halvings[axis] == kEmissionHalvingsMax) continue;
      const Division division{static_cast<Kind>(axis + 1), 0, 0.5};
      // Among axes that gain alike, the longest side: a density that is even now may not be so
      // further down.
      const double weight = WeightOfHalves(box, division, paths) * (1 - 0.01 * box.size[axis]);
      if (best && !(weight < least)) continue;
      best = division;
      least = weight;
    }
    return best;
  }

  static Box PartOf(const Box& box, const Division& division, bool is_upper, double square,
                    double prior) {
    Box part = box;
    const double share = is_upper ? 1 - division.lower_measure : division.lower_measure;
    if (division.kind == Kind::kByLight) {
      (is_upper ? part.first : part.last) = division.light;
    } else {
      const size_t axis = AxisOf(division.kind);
      part.size[axis] *= 0.5;
      if (is_upper) part.lower[axis] += part.size[axis];
      ++part.halvings[axis];
    }
    part.measure *= share;
    part.square = (square + prior * share * box.square) / (1 + prior);
    return part;
  }

  Cost Add(const Box& box, std::span<Path> paths) {
    const size_t index = nodes_.size();
    nodes_.emplace_back();
    const double weight = WeightOf(box);
    if (paths.size() < kEmissionPathsMin) return {weight, 0};
    const std::optional<Division> division = Divide(box, paths);
    if (!division) return {weight, 0};
    const double number = SumsOf(paths).Number();
    const auto middle = std::stable_partition(paths.begin(), paths.end(), [&](const Path& path) {
      return !IsUpper(*division, box, path);
    });
    const auto lower_count = static_cast<size_t>(middle - paths.begin());
    const std::span<Path> lower = paths.first(lower_count), upper = paths.subspan(lower_count);
    const double prior = kEmissionPriorPaths / number;
    const Cost of_lower = Add(PartOf(box, *division, false, SumsOf(lower).square, prior), lower);
    const auto upper_index = static_cast<uint32_t>(nodes_.size());
    const Cost of_upper = Add(PartOf(box, *division, true, SumsOf(upper).square, prior), upper);
    const double parts = of_lower.weight + of_upper.weight;
    const double price =
        of_lower.price + of_upper.price + least_gain_ + weight * (kEmissionPrice / number);
    if (!(parts > 0) || parts + price >= weight) {
      nodes_.resize(index + 1);
      return {weight, 0};
    }
    EmissionField::Node& node = nodes_[index];
    node.kind = static_cast<uint8_t>(division->kind);
    node.upper = upper_index;
    node.light = division->light;
    node.lower_share = static_cast<float>(of_lower.weight / parts);
    return {parts, price};
  }

  const LightEmission& emission_;
  std::vector<Path> paths_;
  std::vector<EmissionField::Node> nodes_;
  double least_gain_ = 0;
};

void EmissionStatistics::Begin(const EmissionField& field, uint64_t paths) {
  iterations_.push_back({field, static_cast<double>(paths)});
  found_.assign(paths, {});
}

EmissionField EmissionStatistics::Fit() {
  const Iteration& last = iterations_.back();
  const GuidedEmission by_last(emission_, &last.field);
  for (Kept& kept : kept_) kept.density += last.paths * by_last.DensityOf(kept.finding.origin);
  for (const EmissionFinding& finding : found_) {
    if (!(finding.square > 0) || !std::isfinite(finding.square)) continue;
    Kept& kept = kept_.emplace_back(Kept{finding, 0, 0});
    const double density = by_last.DensityOf(finding.origin);
    kept.integrand = finding.square * density * density;
    for (const Iteration& iteration : iterations_) {
      kept.density +=
          iteration.paths * GuidedEmission(emission_, &iteration.field).DensityOf(finding.origin);
    }
  }
  found_.clear();
  std::vector<EmissionFit::Path> paths;
  double sum = 0;
  for (const Kept& kept : kept_) {
    const double square = kept.integrand / kept.density;
    if (!(square > 0) || !std::isfinite(square)) continue;
    paths.push_back({kept.finding.origin.light, kept.finding.origin.place.u, square});
    sum += square;
  }
  const double most =
      kEmissionOutlier * sum / static_cast<double>(std::max<size_t>(paths.size(), 1));
  for (EmissionFit::Path& path : paths) path.square = std::min(path.square, most);
  return EmissionFit(*emission_, std::move(paths)).Run();
}

uint64_t EmissionStatistics::memory_bytes() const {
  uint64_t bytes = sizeof(*this) + VectorBytes(iterations_, found_, kept_);
  for (const Iteration& iteration : iterations_) bytes += iteration.field.memory_bytes();
  return bytes;
}

}  // namespace sheaf::render
