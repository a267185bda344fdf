// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/material/node_voronoi.h"

#include <cmath>

#include "common/scene/node_parameters.h"
#include "worker/render/material/node_place.h"

namespace sheaf::render {
namespace {

using namespace node_number;  // NOLINT: the names of this one table.

// Calls add(cell, frequency, amplitude, share) for each octave; share: 1, or the part of the last.
template <typename Add>
void ForEachOctave(const NodeTexture& node, const VoronoiOptions& options, const NodePlace& q,
                   const Add& add) {
  const double detail = NumberOf(node, kVoronoiDetail);
  const int whole = static_cast<int>(detail);
  double frequency = 1, amplitude = 1;
  for (int i = 0; i <= whole + (detail > whole ? 1 : 0); ++i) {
    const NodePlace here = frequency * q;
    add(VoronoiCellAt(options, {here.p, here.w}), frequency, amplitude,
        i <= whole ? 1.0 : detail - whole);
    frequency *= NumberOf(node, kVoronoiLacunarity);
    amplitude *= NumberOf(node, kVoronoiRoughness);
  }
}

double MixOf(double a, double b, double t) { return (1 - t) * a + t * b; }

VoronoiCell SumOfCells(const NodeTexture& node, const VoronoiOptions& options, const NodePlace& q) {
  VoronoiCell sum;
  double amplitudes = 0;
  ForEachOctave(node, options, q,
                [&](const VoronoiCell& cell, double, double amplitude, double share) {
                  sum.distance += share * amplitude * cell.distance;
                  sum.color = sum.color + share * amplitude * cell.color;
                  amplitudes += share * amplitude;
                });
  if (node.numbers[kVoronoiNormalize] == 0) return sum;
  const double side = 0.5 + 0.5 * options.randomness;
  const double most =
      VoronoiReach(options, side) * (options.feature == VoronoiFeature::kF2 ? 2 : 1);
  return {sum.distance / (amplitudes * most), sum.color / amplitudes};
}

VoronoiCell NearestEdge(const NodeTexture& node, const VoronoiOptions& options,
                        const NodePlace& q) {
  constexpr double kFarthest = 8;
  const double side = 0.5 + 0.5 * options.randomness;
  double distance = kFarthest, most = side;
  ForEachOctave(node, options, q,
                [&](const VoronoiCell& cell, double frequency, double amplitude, double share) {
                  const double nearer = std::fmin(distance, cell.distance / frequency);
                  const double least = MixOf(distance, nearer, amplitude);
                  distance =
                      share == 1 ? least : MixOf(distance, std::fmin(distance, least), share);
                  most = MixOf(most, MixOf(most, side / frequency, amplitude), share);
                });
  return {node.numbers[kVoronoiNormalize] == 0 ? distance : distance / most, {}};
}

}  // namespace

VoronoiCell VoronoiNodeAt(const NodeTexture& node, Vec3d p) {
  const VoronoiOptions options{static_cast<VoronoiFeature>(ChoiceOf(node, kVoronoiFeature)),
                               static_cast<VoronoiMetric>(ChoiceOf(node, kVoronoiMetric)),
                               ChoiceOf(node, kVoronoiDimensions),
                               0.5 * NumberOf(node, kVoronoiSmoothness),
                               NumberOf(node, kVoronoiExponent),
                               NumberOf(node, kVoronoiRandomness)};
  const NodePlace q =
      PlaceOf(node, p, kVoronoiDimensions, kVoronoiW, kVoronoiWFrom, NumberOf(node, kVoronoiScale));
  if (NumberOf(node, kVoronoiDetail) == 0 && NumberOf(node, kVoronoiNormalize) == 0) {
    return VoronoiCellAt(options, {q.p, q.w});
  }
  return options.feature == VoronoiFeature::kDistanceToEdge ? NearestEdge(node, options, q)
                                                            : SumOfCells(node, options, q);
}

}  // namespace sheaf::render
