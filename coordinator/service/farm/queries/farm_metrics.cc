// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/queries/farm_metrics.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <string>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "coordinator/scheduling/dependencies.h"
#include "coordinator/service/farm/queries/worker_views.h"

namespace sheaf::coordinator {
namespace {

struct CounterName {
  const char* name;
  const char* help;
  uint64_t Counters::*value;
};
constexpr CounterName kCounterNames[] = {
    {"synchronize_calls", "Synchronize calls of workers.", &Counters::synchronize_calls},
    {"leases_granted", "Leases granted, hedges included.", &Counters::leases_granted},
    {"leases_cold", "Leases of scenes that the worker had to load first.", &Counters::leases_cold},
    {"leases_hedged", "Leases of a task that another worker holds.", &Counters::leases_hedged},
    {"lease_expired", "Leases of workers that stopped responding.", &Counters::leases_expired},
    {"lease_cancelled", "Leases whose work is done or no longer wanted.",
     &Counters::leases_cancelled},
    {"results_accepted", "Results that are durable and merged.", &Counters::results_accepted},
    {"duplicate_equal", "Duplicate results with identical bits.",
     &Counters::results_duplicate_equal},
    {"duplicate_mismatch", "Duplicate results with different bits, from a broken worker.",
     &Counters::results_duplicate_mismatch},
    {"superseded", "Results that were no longer needed.", &Counters::results_superseded},
    {"results_late", "Results accepted after their lease had ended.", &Counters::results_late},
    {"results_invalid", "Results that do not match their key.", &Counters::results_invalid},
    {"results_other_field", "Results made with another guiding field than their frame's.",
     &Counters::results_other_field},
    {"fields_trained", "Guiding fields that are durable.", &Counters::fields_trained},
    {"results_refused", "Results whose work was not leased to the sender.",
     &Counters::results_refused},
    {"failures_refused", "Failures reported of leases that the sender does not hold.",
     &Counters::failures_refused},
    {"checks_begun", "Results rendered again by another worker.", &Counters::checks_begun},
    {"checks_dropped", "Checks that no other worker did in time.", &Counters::checks_dropped},
    {"samples_checked", "Pixel samples and light paths rendered for checks.",
     &Counters::samples_checked},
    {"parts_revoked", "Parts that were lost or found false and are rendered again.",
     &Counters::parts_revoked},
    {"parts_unrecorded",
     "Files of parts whose rows were lost in a crash or by damage: rendered "
     "again.",
     &Counters::parts_unrecorded},
    {"commits_lost", "Changes that the database lost by damage to its log; 0 on good disks.",
     &Counters::commits_lost},
    {"workers_lost", "Workers that stopped responding without announcing a stop.",
     &Counters::workers_lost},
    {"workers_quarantined", "Workers that were excluded.", &Counters::workers_quarantined},
    {"workers_sick", "Workers that failed tasks of several jobs that others rendered.",
     &Counters::workers_sick},
    {"tasks_poisoned", "Tasks set aside because too many workers failed them.",
     &Counters::tasks_poisoned},
    {"tasks_killed", "Tasks and frames set aside by users.", &Counters::tasks_killed},
    {"tasks_retried", "Tasks and frames that were set aside and then retried by users.",
     &Counters::tasks_retried},
    {"frames_incomplete", "Frames that ended with tasks set aside.", &Counters::frames_incomplete},
    {"samples_accepted", "Pixel samples and light paths of accepted results.",
     &Counters::samples_accepted},
    {"rays_accepted", "Rays of accepted results.", &Counters::rays_accepted},
    {"nonfinite_samples", "Samples that were not finite; anything but 0 is a defect.",
     &Counters::nonfinite_samples},
    {"jobs_refused", "Jobs and refinements beyond a user's limit of unfinished work.",
     &Counters::jobs_refused},
    {"frames_delivered", "Frames whose EXR is written.", &Counters::frames_delivered},
    {"scenes_lost", "Scenes of live jobs with a file found damaged or lost.",
     &Counters::scenes_lost},
};

MetricView Gauge(const std::string& name, const std::string& help, double value) {
  return {"sheaf_" + name, help, MetricView::Kind::kGauge, "", "", value};
}

// Live jobs that /metrics lists individually, the oldest first; the rest are summed as kOther.
constexpr size_t kJobMetricsMax = 200;

struct JobMetric {
  const char* name;
  const char* help;
  double (*value)(const JobCurve&);
  bool is_sum = false;  // Over jobs.
};
constexpr JobMetric kJobMetrics[] = {
    {"job_samples", "Pixel samples of a live job so far.",
     [](const JobCurve& curve) { return curve.samples; }, /*is_sum=*/true},
    {"job_cpu_seconds", "CPU time of a live job.",
     [](const JobCurve& curve) { return curve.cpu_seconds; }, /*is_sum=*/true},
    {"job_part_bytes", "Bytes of parts that a live job has received.",
     [](const JobCurve& curve) { return curve.part_bytes; }, /*is_sum=*/true},
    {"job_relative_mse", "The largest relMSE of a live job's frames, at their last rounds.",
     [](const JobCurve& curve) { return curve.relative_mse; }},
    {"job_relative_mse_predicted",
     "The largest relMSE predicted for the next rounds of a live job.",
     [](const JobCurve& curve) { return curve.predicted_relative_mse; }},
    {"job_prediction_ratio", "Measured over predicted relMSE, mean over a live job's rounds.",
     [](const JobCurve& curve) {
       return curve.prediction_count == 0 ? 0 : curve.ratio_sum / curve.prediction_count;
     }},
};

// Adds the ratios of the errors of a job's frames to their predictions.
void AddErrors(const std::map<int32_t, std::vector<RoundRecord>>& rounds_by_frame,
               JobCurve* curve) {
  for (const auto& [number, rounds] : rounds_by_frame) {
    curve->relative_mse = std::max(curve->relative_mse, rounds.back().relative_mse);
    curve->predicted_relative_mse =
        std::max(curve->predicted_relative_mse, rounds.back().predicted_relative_mse);
    for (size_t i = 1; i < rounds.size(); ++i) {
      if (!(rounds[i - 1].predicted_relative_mse > 0)) continue;
      curve->ratio_sum += rounds[i].relative_mse / rounds[i - 1].predicted_relative_mse;
      ++curve->prediction_count;
    }
  }
}

}  // namespace

FarmMetrics::LiveFigures FarmMetrics::ListLive(size_t count_max) const {
  LiveFigures live;
  for (const auto& [id, job] : tables_.scheduler.jobs()) {
    if (job.phase != JobPhase::kLive) continue;
    const bool is_shown = live.jobs.size() < count_max;
    JobCurve& curve = is_shown ? live.jobs.emplace_back(id, JobCurve()).second : live.more;
    live.more_count += is_shown ? 0 : 1;
    UserFigures& user = live.users[job.spec.owner];
    ++user.jobs;
    for (const FrameRecord& frame : job.frames) {
      const auto samples = static_cast<double>(frame.sample_count_done);
      const double cpu_seconds = absl::ToDoubleSeconds(frame.cost.cpu_duration);
      curve.samples += samples;
      curve.cpu_seconds += cpu_seconds;
      curve.part_bytes += static_cast<double>(frame.cost.part_bytes);
      user.samples += samples;
      user.cpu_seconds += cpu_seconds;
    }
    if (is_shown) AddErrors(tables_.accounts.at(id).rounds, &curve);
  }
  return live;
}

std::vector<LeasableWork> FarmMetrics::ListLeasable() const {
  std::vector<LeasableWork> works;
  const JobRecords& jobs = tables_.scheduler.jobs();
  for (const auto& [id, job] : jobs) {
    if (job.phase != JobPhase::kLive || job.Paused() || !WhyHeld(jobs, job).empty()) continue;
    uint64_t left = 0, all = 0;
    for (const FrameRecord& frame : job.frames) {
      if (frame.phase == FrameRecord::Phase::kIncomplete) continue;
      const uint64_t expected = tables_.SamplesExpected({id, frame.number()}, frame);
      left += expected - std::min(expected, frame.sample_count_done);
      all += expected;
    }
    if (left == 0) continue;
    double cost = WorkLeftOf(job, left).cpu_seconds_per_sample;
    if (cost <= 0) cost = job.spec.deadline.cpu_seconds / static_cast<double>(all);
    works.push_back({job.spec.requirements.pool, static_cast<double>(left), cost});
  }
  return works;
}

std::vector<MetricView> FarmMetrics::ListDisk() const {
  std::vector<MetricView> metrics = {
      Gauge("disk_writable", "Whether the last write to the state directory succeeded: 1 or 0.",
            disk_.Last().ok() ? 1 : 0)};
  std::error_code error;
  const std::filesystem::space_info space = std::filesystem::space(state_directory_, error);
  if (error) return metrics;
  metrics.push_back(Gauge("disk_free_bytes",
                          "Bytes that the coordinator may still write to the state directory's "
                          "disk.",
                          static_cast<double>(space.available)));
  metrics.push_back(Gauge("disk_size_bytes", "Size of the state directory's disk.",
                          static_cast<double>(space.capacity)));
  return metrics;
}

std::vector<MetricView> FarmMetrics::List() const {
  std::vector<MetricView> metrics = ListDisk();
  const MutexLock lock(&tables_.mutex);
  const Counters& counters = tables_.scheduler.counters();
  for (const CounterName& counter : kCounterNames) {
    metrics.push_back({absl::StrCat("sheaf_", counter.name, "_total"), counter.help,
                       MetricView::Kind::kCounter, "", "",
                       static_cast<double>(counters.*counter.value)});
  }
  for (int kind = 0; kind < kFailureKindCount; ++kind) {
    metrics.push_back({"sheaf_lease_failures_total", "Failed leases, by class.",
                       MetricView::Kind::kCounter, "kind",
                       FailureKindName(static_cast<FailureKind>(kind)),
                       static_cast<double>(counters.failures[static_cast<size_t>(kind)])});
  }
  std::map<WorkerState, int> by_state;
  for (const auto& [id, worker] : tables_.scheduler.workers().workers()) {
    ++by_state[StateOf(worker)];
  }
  for (const WorkerState state : kWorkerStates) {
    metrics.push_back({"sheaf_workers", "Workers, by state.", MetricView::Kind::kGauge, "state",
                       WorkerStateName(state), static_cast<double>(by_state[state])});
  }
  int live_jobs = 0;
  int paused_jobs = 0;
  for (const auto& [id, job] : tables_.scheduler.jobs()) {
    if (job.phase != JobPhase::kLive) continue;
    ++live_jobs;
    paused_jobs += job.Paused() ? 1 : 0;
  }
  metrics.push_back(Gauge("jobs_live", "Jobs that have not ended.", live_jobs));
  metrics.push_back(Gauge("jobs_paused", "Live jobs that users have paused.", paused_jobs));
  const LiveFigures live = ListLive(kJobMetricsMax);
  for (const JobMetric& metric : kJobMetrics) {
    const std::string name = absl::StrCat("sheaf_", metric.name);
    for (const auto& [id, curve] : live.jobs) {
      metrics.push_back({name, metric.help, MetricView::Kind::kGauge, "job",
                         absl::StrCat("jobs/", id), metric.value(curve)});
    }
    if (live.more_count > 0 && metric.is_sum) {
      metrics.push_back(
          {name, metric.help, MetricView::Kind::kGauge, "job", kOther, metric.value(live.more)});
    }
  }
  AddUserMetrics(live.users, &metrics);
  AddWorkMetrics(ListLeasable(), &metrics);
  metrics.push_back({"sheaf_images_damaged_total",
                     "Delivered EXRs that were altered or removed on disk and are recreated.",
                     MetricView::Kind::kCounter, "", "",
                     static_cast<double>(images_.DamagedCount())});
  metrics.push_back(Gauge("leases_held", "Leases that workers hold now.",
                          static_cast<double>(tables_.scheduler.leases().size())));
  metrics.push_back(Gauge("frames_open", "Frames between their first part and their delivery.",
                          static_cast<double>(tables_.open_frames.size())));
  metrics.push_back(Gauge("merge_bytes", "Memory of unfinished tiles and of certificates.",
                          static_cast<double>(tables_.merge_budget.bytes())));
  metrics.push_back(
      Gauge("parts_bytes", "Bytes of parts on disk.", static_cast<double>(store_.PartsBytes())));
  return metrics;
}

uint64_t FarmMetrics::MergeBytes() const {
  const MutexLock lock(&tables_.mutex);
  return static_cast<uint64_t>(tables_.merge_budget.bytes());
}

}  // namespace sheaf::coordinator
