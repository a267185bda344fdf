// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EmissionStatistics: what the light paths of a training brought to the picture, by the places at
// which they began; Fit: the EmissionField that follows from them.
//
// The variance of the picture's light paths is the integral of f^2 / q, where f^2 sums the squares
// of what a path brings to pixels, and q is the density of the paths. It is least for q ~ rms(f) in
// each cell, and then equals the squared sum of the cells' weights, sqrt(measure * integral of
// f^2). So the tree of cells minimizes that sum plus a price for each cell (as MapPartition does),
// which is what cells gain by chance: the fewer paths there are in a cell, the more expensive it is
// to divide it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "worker/render/guiding/emission_field.h"
#include "worker/render/guiding/guided_emission.h"

namespace sheaf::render {

// The gain that pays for dividing a cell, relative to its weight: this over the effective number of
// its paths. A cell of n equal paths gains about 1 / (8 n) by chance.
inline constexpr double kEmissionPrice = 1;
// The same, relative to the weight of all cells: finer cells are not worth their memory.
inline constexpr double kEmissionLeastGain = 0x1p-17;
// A cell with fewer paths is not divided.
inline constexpr size_t kEmissionPathsMin = 8;
// Parts of a cell inherit its estimate with the weight of this many of its paths.
inline constexpr double kEmissionPriorPaths = 1;
// A path counts at most as this many mean ones: few paths must not decide.
inline constexpr double kEmissionOutlier = 256;

// A path that brought light.
struct EmissionFinding {
  EmissionOrigin origin;
  double square = 0;  // The sum of the squares of what it brought to pixels.
};

class EmissionStatistics {
 public:
  // emission: must outlive *this.
  explicit EmissionStatistics(const LightEmission& emission) : emission_(&emission) {}

  // Begins an iteration of `paths` paths, which begin by the field.
  void Begin(const EmissionField& field, uint64_t paths);
  // The path of the iteration, by its number, brought light. May be called from many threads, once
  // for each path.
  void Add(uint64_t path, const EmissionFinding& finding) { found_[path] = finding; }
  // The field by all iterations so far; empty where no path brought light. A pure function of what
  // the paths brought.
  EmissionField Fit();

  uint64_t memory_bytes() const;

 private:
  struct Kept {
    EmissionFinding finding;
    double integrand = 0;  // Its square, as f^2 per measure.
    double density = 0;    // The density of the paths of all iterations at this place.
  };
  struct Iteration {
    EmissionField field;
    double paths = 0;
  };

  const LightEmission* emission_;
  std::vector<Iteration> iterations_;
  std::vector<EmissionFinding> found_;  // By path of the last iteration.
  std::vector<Kept> kept_;              // In the order of iterations and paths.
};

}  // namespace sheaf::render
