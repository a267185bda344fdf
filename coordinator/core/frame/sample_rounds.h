// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Rounds: how a frame with a StopRule gets its samples. Cells are tiles, or squares of them
// (cell_grid.h). The first round gives every cell the same small number of samples. When all cells
// have their samples, DecideRound examines the merged image, and either ends the frame or sets each
// cell's number of samples for the next round:
//
//     parts of all cells > EstimateCellErrors > DecideRound > FrameTasks::Grow, or delivery
//
// The first round has the smallest number of samples for which errors can be estimated, one in each
// replicate.
//
// The decision is a pure function of merged data (and of clocks, where there are time limits), so
// that the image does not depend on which workers rendered it. It is stored before any worker
// starts on the next round.
//
// Samples are given to the cells where they reduce the frame's error most. A cell whose pixels have
// the error k / n^b at n samples gets samples in proportion to k^(1 / (1 + b)). This minimizes the
// sum of samples for a given sum of errors, as in Neyman's allocation to strata (Cochran 1977,
// Sampling Techniques, sec. 5.5). b is 1 for independent samples, and larger for samples of one
// low-discrepancy sequence; it is measured from one round to the next. No cell gets more than
// kRoundGrowthMax times its present samples, so that an inaccurate early estimate wastes little,
// and the round that is predicted to reach the target gets only the samples that the target needs.
//
// The target is reached when the upper confidence bound of the frame's error is not above it. Every
// round tests this, and each test may succeed by chance, so the probability of a miss is divided
// among the tests: the k-th test (from 1) may miss with probability 6 / (pi k)^2 kMissProbability,
// and all tests together with at most kMissProbability.
//
// Error estimates do not include features that no sample has hit. All samples may miss small
// features in front of a smooth background, such as lamps of less than a pixel, and then the
// estimated error is zero. If such features put a frame off by the target, they are in at least
// that fraction of its pixels, because the relative error is at most 1. If they cover the fraction
// kCoverageSeen of each of these pixels, n samples per pixel miss all of them with the probability
// exp(-n kCoverageSeen target pixels). So every cell ends with at least as many samples as make
// that kMissProbability (3 = -ln 0.05: Hanley and Lippman-Hand 1983, "If Nothing Goes Wrong, Is
// Everything All Right?"). Features that cover less may be missing.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "common/film/error/error_estimate.h"
#include "common/film/film_tile.h"
#include "coordinator/core/job/job.h"

namespace sheaf::coordinator {

// A round gives a cell at most this many times its present samples.
inline constexpr uint64_t kRoundGrowthMax = 4;
// A round adds at least this fraction of the frame's present samples, which limits the number of
// rounds.
inline constexpr double kRoundGrowthMin = 1.0 / 16;
// The prior of b, the rate at which errors fall, over scenes of all kinds.
inline constexpr double kRatePrior = 1.1, kRatePriorDeviation = 0.1;
// The fraction of frames that may stop although their expected error is above the target.
inline constexpr double kMissProbability = 0.05;
// See above. A frame of 640 x 360 pixels with a target of 0.01 needs no sample for it.
inline constexpr double kCoverageSeen = 1.0 / 512;
// The most samples per pixel that this rule requires, in frames of few pixels.
inline constexpr double kLookSamplesMax = 8 * kReplicateCount;
// Standard deviations between a point of an error curve and its upper bound, for frames without
// rounds: 95 of 100 normal values lie below.
inline constexpr double kPointDeviations = 1.645;

// A cell at the end of a round.
struct CellRound {
  uint64_t samples = 0;  // Per pixel.
  ErrorSums error;
};

// The samples per pixel that a frame needs before the target can be said to be reached.
double SamplesToTrust(double target_error, int64_t pixel_count);

// The sum over all cells.
ErrorSums SumOf(std::span<const CellRound> cells);
double PixelSamples(std::span<const CellRound> cells);

struct RoundDecision {
  // Samples per pixel of each cell in the next round. No value is below the present one, and all
  // are multiples of kReplicateCount, except for the maximum. Empty if the frame is done.
  std::vector<uint64_t> samples;
  StopReason reason = StopReason::kSamples;  // Valid if the frame is done.
  double relative_mse = 0;
  double relative_mse_upper = 0;      // At the confidence of this test.
  double predicted_relative_mse = 0;  // After the next round; 0 if there is none.
  // Pixel samples that the frame is expected to end with, including its present ones.
  uint64_t sample_count_expected = 0;
};

// A round of a frame, and the decision at its end.
struct RoundRecord {
  int32_t round = 0;
  // By cell: its state at the end of the round, and its samples in the next round.
  std::vector<CellRound> cells;
  std::vector<uint64_t> samples_next;             // Empty for the last round.
  StopReason stop_reason = StopReason::kSamples;  // Set in the last round.
  double relative_mse = 0, relative_mse_upper = 0, predicted_relative_mse = 0;
  double certified_upper = 0;          // The merged image's (certificate.h); 0 if it has none.
  uint64_t sample_count = 0;           // Pixel samples of the frame so far.
  uint64_t sample_count_expected = 0;  // See RoundDecision.
  absl::Duration wall_duration;
  ResultCost cost;

  void Take(RoundDecision decision);
};

// The limits set by clocks, in pixel samples of the whole frame, including its present ones.
struct RoundAllowance {
  double time = std::numeric_limits<double>::infinity();
  double cpu = std::numeric_limits<double>::infinity();
};

// Decides what follows a finished round. round: its number, from 0. before: the cells at the end of
// the previous round; empty in round 0. samples_max: per pixel. Requires: as many cells as in
// `before`, unless it is empty.
RoundDecision DecideRound(const StopRule& rule, uint64_t samples_max, int round,
                          std::span<const CellRound> cells, std::span<const CellRound> before,
                          const RoundAllowance& allowance);

// The same for any rule: `record` is the finished round, without its decision (DecideRound, or
// certified_rounds.h).
RoundDecision DecideAfter(const RoundRecord& record, const StopRule& rule, uint64_t samples_max,
                          std::span<const CellRound> before, const RoundAllowance& allowance);

// A decision with the errors of a finished round alone.
RoundDecision ErrorsOfRound(int round, std::span<const CellRound> cells);

// Predicts the errors of a cell with `samples` samples per pixel if they fall at `rate`. The
// variance of squared errors exceeds that of normal noise with equal variance in all pixels. This
// excess kurtosis falls as 1 / n relative to the squares, and with it the distance between bound
// and estimate. Source: Cramér 1946, Mathematical Methods of Statistics, sec. 27.4 (variance of a
// variance).
ErrorSums ForeseeError(const CellRound& cell, double samples, double rate);

// Measures the exponent b at which errors fell from `before` to `cells`, clamped to [1, 2]. Returns
// kRatePrior if `before` is empty, or if errors fell by too little. Requires: as many cells as in
// `before`, unless it is empty.
double MeasureRate(std::span<const CellRound> cells, std::span<const CellRound> before);

// Finds the rounds that remain valid under another rule, for a frame that continues. Repeats the
// decision at the end of each round and keeps the round while the decision is the same. The first
// round with a different decision becomes the last of `rounds` and gets the new decision, so that
// the frame continues as if it had always had this rule; samples that cells have beyond that are
// not used. Returns whether more must be rendered. Ignores clocks. Requires: rounds with cells.
bool ReplayRounds(const StopRule& rule, uint64_t samples_max, std::vector<RoundRecord>* rounds);

}  // namespace sheaf::coordinator
