// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/queries/refinement_pricing.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "coordinator/core/job/cell_grid.h"
#include "coordinator/service/farm/jobs/job_continuation.h"

namespace sheaf::coordinator {
namespace {

absl::Status CheckTargets(const std::vector<double>& target_errors) {
  if (target_errors.empty() || target_errors.size() > kPricedTargetsMax) {
    return absl::InvalidArgumentError(absl::StrCat("target_error: ", target_errors.size(),
                                                   " values, not 1 to ", kPricedTargetsMax));
  }
  for (const double target : target_errors) {
    if (target > 0 && target <= kTargetErrorMax) continue;
    return absl::InvalidArgumentError(
        absl::StrCat("target_error: ", target, " is not above 0 and at most ", kTargetErrorMax));
  }
  return absl::OkStatus();
}

// The end of a frame as one cell, for frames of earlier versions, which stored only that.
RoundRecord WholeFrame(const FrameSpec& spec, const DeliveredFrame& delivered) {
  // Mean square of a pixel's error over the square of the mean.
  constexpr double kSquareRatio = 4;
  const int64_t pixel_count = spec.settings.window.PixelCount();
  const double sum = delivered.relative_mse * static_cast<double>(pixel_count);
  RoundRecord record;
  record.cells.push_back(
      {spec.settings.samples, {pixel_count, sum, kSquareRatio * delivered.relative_mse * sum}});
  return record;
}

// The time of light passes does not belong to a tile, and more camera samples cause more passes. So
// each tile's time is scaled such that the tiles sum to the frame's time.
void AddLightPasses(double frame_seconds, std::vector<double>* seconds_of_tiles) {
  const double sum = std::accumulate(seconds_of_tiles->begin(), seconds_of_tiles->end(), 0.0);
  if (!(sum > 0)) return;
  for (double& seconds : *seconds_of_tiles) seconds *= frame_seconds / sum;
}

// Distributes each tile's CPU time among its cells by their samples.
std::vector<double> DistributeCpuTime(const CellGrid& grid,
                                      const std::vector<double>& seconds_of_tiles,
                                      const std::vector<RoundRecord>& rounds) {
  const std::vector<PixelRect>& cells = grid.cells();
  const bool known = !rounds.empty() && rounds.back().cells.size() == cells.size();
  std::vector<double> work;
  for (size_t i = 0; i < cells.size(); ++i) {
    const uint64_t samples = known ? rounds.back().cells[i].samples : 1;
    work.push_back(static_cast<double>(cells[i].PixelCount()) * static_cast<double>(samples));
  }
  return grid.Distribute(seconds_of_tiles, work);
}

}  // namespace

struct RefinementPricing::Priced {
  uint64_t job_id = 0;
  // Some frames, evenly over the job's range.
  std::vector<std::pair<FrameSpec, DeliveredFrame>> frames;
  size_t frame_count = 0;  // All frames of the job.
  Partition partition;
  uint64_t samples_max = kStoppedSamplesMax;
  int32_t priority = 0;
  FarmLoad load;
  int32_t thread_count = 0;  // As in RefinementPrices; this and the next.
  int32_t jobs_before_count = 0;
};

absl::Status RefinementPricing::Look(const std::string& job_id,
                                     const std::vector<double>& target_errors,
                                     Priced* priced) const {
  const bool is_number = absl::SimpleAtoi(job_id, &priced->job_id);
  const MutexLock lock(&tables_.mutex);
  const absl::StatusOr<const JobRecord*> found = tables_.FindJob(is_number ? priced->job_id : 0);
  if (!found.ok()) return found.status();
  const JobRecord& job = **found;
  // First: clients request fractions of the job's error, which a new job does not have.
  if (absl::Status s = RequireSucceeded(job); !s.ok()) return s;
  if (absl::Status s = CheckTargets(target_errors); !s.ok()) return s;
  priced->frame_count = job.frames.size();
  priced->partition = job.spec.partition;
  const std::map<int32_t, DeliveredFrame>& delivered =
      tables_.accounts.at(priced->job_id).delivered;
  const size_t count = std::min(kPricedFramesMax, priced->frame_count);
  for (size_t i = 0; i < count; ++i) {
    const size_t index = count == 1 ? 0 : i * (priced->frame_count - 1) / (count - 1);
    const FrameSpec spec = job.frames[index].Spec();
    priced->samples_max = std::max(priced->samples_max, spec.settings.samples);
    priced->frames.emplace_back(spec, delivered.at(spec.frame_number));
  }
  priced->priority = job.spec.priority;
  priced->load = tables_.LoadOf(job.spec.numeric_profile, SteadyTime::Now());
  for (const auto& [id, worker] : tables_.scheduler.workers().workers()) {
    if (worker.Live() && worker.numeric_profile == job.spec.numeric_profile) {
      priced->thread_count += worker.thread_count;
    }
  }
  for (const auto& [id, other] : tables_.scheduler.jobs()) {
    if (other.phase == JobPhase::kLive && !other.Paused() && !IsPilot(id) &&
        other.spec.priority >= job.spec.priority) {
      ++priced->jobs_before_count;
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<FinishedFrame> RefinementPricing::FinishedFrameOf(
    const FrameId& id, const FrameSpec& spec, const Partition& partition,
    const DeliveredFrame& delivered) const {
  absl::StatusOr<std::vector<RoundRecord>> rounds = store_.LoadFrameRounds(id);
  if (!rounds.ok()) return rounds.status();
  const absl::StatusOr<std::vector<JobStore::TileCost>> costs = store_.TileCosts(id);
  if (!costs.ok()) return costs.status();
  FinishedFrame frame;
  frame.had_rule = spec.stop.IsActive();
  frame.first_round_samples =
      frame.had_rule ? spec.stop.first_round_samples : spec.settings.samples;
  frame.rounds = *std::move(rounds);
  frame.cpu_seconds = absl::ToDoubleSeconds(delivered.cost.cpu_duration);
  std::map<std::pair<int32_t, int32_t>, double> seconds_at;  // By y0 and x0.
  for (const JobStore::TileCost& cost : *costs) {
    seconds_at[{cost.tile.y0, cost.tile.x0}] = absl::ToDoubleSeconds(cost.cpu_duration);
  }
  const CellGrid grid(spec, partition);
  if (seconds_at.size() == grid.tiles().size()) {
    std::vector<double> seconds;
    for (const PixelRect& tile : grid.tiles()) seconds.push_back(seconds_at[{tile.y0, tile.x0}]);
    if (grid.light_tile()) AddLightPasses(frame.cpu_seconds, &seconds);
    frame.cpu_seconds_of_cells = DistributeCpuTime(grid, seconds, frame.rounds);
  }
  if (!frame.rounds.empty()) return frame;
  frame.rounds.push_back(WholeFrame(spec, delivered));
  if (!frame.cpu_seconds_of_cells.empty()) {
    frame.cpu_seconds_of_cells.assign(1, frame.cpu_seconds);
  }
  return frame;
}

absl::StatusOr<RefinementPrices> RefinementPricing::Price(
    const std::string& job_id, const std::vector<double>& target_errors) const {
  Priced priced;
  if (absl::Status s = Look(job_id, target_errors, &priced); !s.ok()) return s;
  std::vector<FinishedFrame> frames;
  for (const auto& [spec, delivered] : priced.frames) {
    absl::StatusOr<FinishedFrame> frame =
        FinishedFrameOf({priced.job_id, spec.frame_number}, spec, priced.partition, delivered);
    if (!frame.ok()) return frame.status();
    frames.push_back(*std::move(frame));
  }
  return RefinementPrices{PriceRefinement(frames, priced.frame_count, target_errors,
                                          priced.samples_max, priced.priority, priced.load),
                          priced.thread_count, priced.jobs_before_count};
}

}  // namespace sheaf::coordinator
