// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/job_record.h"

#include <algorithm>

#include "absl/time/time.h"
#include "common/base/check.h"

namespace sheaf::coordinator {

uint64_t FirstRoundSamplesOf(const FrameRecord& frame) {
  const uint64_t samples = frame.settings().samples;
  const StopRule& stop = frame.stop();
  return stop.IsActive() ? std::min(samples, stop.first_round_samples) : samples;
}

uint64_t SampleCountTotal(const FrameRecord& frame) {
  if (frame.tasks != nullptr) return frame.tasks->sample_count_total();
  if (frame.phase == FrameRecord::Phase::kDelivered) return frame.sample_count_done;
  const FrameSettings& settings = frame.settings();
  const uint64_t paths = settings.lattice.All()
                             ? PathsPerSample(settings)
                             : static_cast<uint64_t>(settings.lattice.CountIn(settings.window));
  return paths * FirstRoundSamplesOf(frame);
}

std::optional<uint32_t> JobRecord::FindIndex(int32_t frame_number) const {
  const auto found = std::ranges::lower_bound(frames, frame_number, {}, &FrameRecord::number);
  if (found == frames.end() || found->number() != frame_number) return std::nullopt;
  return static_cast<uint32_t>(found - frames.begin());
}

uint32_t JobRecord::IndexOf(int32_t frame_number) const {
  const std::optional<uint32_t> index = FindIndex(frame_number);
  SHEAF_CHECK(index.has_value());
  return *index;
}

absl::Duration ExpectedCpu(const FrameRecord& frame, const Task& task,
                           absl::Duration unless_known) {
  const uint64_t samples = frame.tasks == nullptr ? 0 : frame.tasks->PixelSamples(task);
  if (frame.sample_count_timed == 0 || samples == 0) return unless_known;
  return frame.cost.cpu_duration *
         (static_cast<double>(samples) / static_cast<double>(frame.sample_count_timed));
}

SteadyTime FirstLeaseTime(const JobRecord& job) {
  SteadyTime first = SteadyTime::InfiniteFuture();
  for (const FrameRecord& frame : job.frames) first = std::min(first, frame.first_lease_time);
  return first;
}

WorkLeft WorkLeftOf(const JobRecord& job, uint64_t sample_count_left) {
  double cpu_seconds = 0, samples = 0;
  for (const FrameRecord& frame : job.frames) {
    cpu_seconds += absl::ToDoubleSeconds(frame.cost.cpu_duration);
    samples += static_cast<double>(frame.sample_count_timed);
  }
  return {job.spec.priority, static_cast<double>(sample_count_left),
          samples > 0 ? cpu_seconds / samples : 0};
}

double SamplesPerThreadSecond(const FrameRecord& frame, const WorkerRecord& worker) {
  const double cpu_seconds = absl::ToDoubleSeconds(frame.cost.cpu_duration);
  if (frame.sample_count_timed == 0 || cpu_seconds <= 0) return worker.SamplesPerThreadSecond();
  return worker.RelativeSpeed() * static_cast<double>(frame.sample_count_timed) / cpu_seconds;
}

bool JobRecord::IsRefusedByCacheOf(const std::string& worker_id, SteadyTime now) const {
  const auto refusal = cache_refusals.find(worker_id);
  return refusal != cache_refusals.end() && now < refusal->second.not_before;
}

}  // namespace sheaf::coordinator
