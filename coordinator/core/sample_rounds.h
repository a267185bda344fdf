// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Rounds: how a frame with a StopRule gets its samples. Cells are tiles, or squares of them
// (cell_grid.h). The first round gives every cell the same few; when all cells have theirs,
// DecideRound looks at the merged image and either ends the frame or gives each cell its count
// for the next round:
//
//     parts of all cells > EstimateCellErrors > DecideRound > FrameTasks::Grow, or delivery
//
// The first round has the least samples with which errors can be told, one of each replicate.
//
// The decision is a pure function of merged data (and, for limits of time, of clocks), so that the
// image does not depend on who rendered it; it is stored before anybody works on it.
//
// Samples go where they lower the frame's error most. A cell whose pixels err by k / n^b at n
// samples gets them in proportion to k^(1 / (1 + b)): the least sum of samples for a given sum of
// errors, as in Neyman's allocation to strata (Cochran 1977, Sampling Techniques, sec. 5.5). b is 1
// for independent samples, and more where those of one sequence do better; it is measured from one
// round to the next. No cell gets more than kRoundGrowthMax times what it has, so that a guess
// from few samples costs little, and the round that is predicted to reach the target is cut to it.
//
// The target is reached when the upper confidence bound of the frame's error is no larger. Frames
// are looked at after every round, which gives luck as many chances; so the confidence is spent
// over the looks: the k-th (from 1) takes 6 / (pi k)^2 of kMissProbability, and all of them
// together no more than kMissProbability.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "common/film/error/error_estimate.h"
#include "common/film/film_tile.h"
#include "coordinator/core/job.h"

namespace sheaf::coordinator {

// At most so many times the samples that a cell has.
inline constexpr uint64_t kRoundGrowthMax = 4;
// At least this share of the samples that the frame has, lest rounds become endless.
inline constexpr double kRoundGrowthMin = 1.0 / 16;
// The rate b at which errors fall, before anything tells: over scenes of all kinds.
inline constexpr double kRatePrior = 1.1, kRatePriorDeviation = 0.1;
// The fraction of all frames that may stop although their expected error is above the target.
inline constexpr double kMissProbability = 0.05;
// Standard deviations from the error of a point to its upper bound, on curves of frames without
// rounds: 95 of 100 normal values are below.
inline constexpr double kPointDeviations = 1.645;

// A cell at the end of a round.
struct CellRound {
  uint64_t samples = 0;  // Per pixel.
  ErrorSums error;
};

// The sum over all cells.
ErrorSums SumOf(std::span<const CellRound> cells);
double PixelSamples(std::span<const CellRound> cells);

struct RoundDecision {
  // Samples of each cell's pixels in the next round, none less than now, all multiples of
  // kReplicateCount but for the largest count allowed. Empty: the frame is done.
  std::vector<uint64_t> samples;
  StopReason reason = StopReason::kSamples;  // Where it is done.
  double relative_mse = 0;
  double relative_mse_upper = 0;      // At the confidence of this look.
  double predicted_relative_mse = 0;  // After the next round; 0 where there is none.
  // Pixel samples of the frame, all that it has had included, that it is expected to end with.
  uint64_t sample_count_expected = 0;
};

// A round of a frame, as it was decided at its end.
struct RoundRecord {
  int32_t round = 0;
  // By cell: its state at the end of the round, and its samples in the next one.
  std::vector<CellRound> cells;
  std::vector<uint64_t> samples_next;             // Empty for the last round.
  StopReason stop_reason = StopReason::kSamples;  // Set in the last round.
  double relative_mse = 0, relative_mse_upper = 0, predicted_relative_mse = 0;
  uint64_t sample_count = 0;           // Pixel samples of the frame so far.
  uint64_t sample_count_expected = 0;  // RoundDecision's.
  absl::Duration wall_duration;
  ResultCost cost;

  void Take(RoundDecision decision);
};

// The limits that clocks set, in pixel samples of the whole frame, including those it has.
struct RoundAllowance {
  double time = std::numeric_limits<double>::infinity();
  double cpu = std::numeric_limits<double>::infinity();
};

// round: from 0, the one that was just finished. `before`: the cells at the end of the round before
// it; empty for the first. samples_max: of a pixel.
// Requires: as many cells as before.
RoundDecision DecideRound(const StopRule& rule, uint64_t samples_max, int round,
                          std::span<const CellRound> cells, std::span<const CellRound> before,
                          const RoundAllowance& allowance);

// The errors of the cell when its pixels have so many samples, falling at `rate`. Squared errors
// vary more than those of normal noise, which vary least where pixels are equal. This excess
// kurtosis falls as 1 / n beside the squares, and with it the distance between bound and estimate.
// Source: Cramér 1946, Mathematical Methods of Statistics, sec. 27.4 (variance of a variance).
ErrorSums ForeseeError(const CellRound& cell, double samples, double rate);

// b with which the errors of `before` came to those of `cells`, from 1 to 2; kRatePrior where there
// are no earlier ones, or errors fell by too little to tell. Requires: as many cells as before.
double MeasureRate(std::span<const CellRound> cells, std::span<const CellRound> before);

// Finds the rounds of a frame that hold under another rule, for a frame that continues: decisions
// are made again from the findings of each round, and kept as long as they are the same. The first
// that differs is the last of `rounds` and has the new decision, so that the frame continues as if
// it had never had another rule; cells that have more samples by now do without those. Returns
// whether there is more to render. Clocks are ignored. Requires: rounds have their cells.
bool ReplayRounds(const StopRule& rule, uint64_t samples_max, std::vector<RoundRecord>* rounds);

}  // namespace sheaf::coordinator
