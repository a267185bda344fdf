// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/sim/stranger.h"

#include <optional>
#include <vector>

#include "common/base/digest.h"
#include "tests/sim/synthetic_film.h"

namespace sheaf::sim {
namespace {

using coordinator::Farm;

constexpr uint64_t kNumbers[] = {0, 1, 2, 3, 8, 16, 64, uint64_t{1} << 32, UINT64_MAX};

// The lease that the result would be of.
worker::Lease LeaseOf(const coordinator::ResultReport& report) {
  worker::Lease lease;
  lease.frame_digest = report.frame_digest;
  lease.tile = report.tile;
  lease.block = report.block;
  lease.cells = report.cells;
  lease.kind = report.kind;
  lease.field.sha256_hex = report.field;
  return lease;
}

// Failures of the classes that only workers report.
uint64_t ReportedFailures(Farm& farm) {
  using coordinator::FailureKind;
  const MutexLock lock(&farm.tables().mutex);
  const auto& failures = farm.tables().scheduler.counters().failures;
  uint64_t sum = 0;
  for (const FailureKind kind : {FailureKind::kInfrastructure, FailureKind::kScene,
                                 FailureKind::kMemory, FailureKind::kInternal}) {
    sum += failures[static_cast<size_t>(kind)];
  }
  return sum;
}

}  // namespace

void Stranger::Send() {
  const uint64_t kind = random_.Below(4);
  const auto serve = [this, kind](Farm& farm) -> Network::Reply {
    world_.Trace("a stranger sends message ", kind);
    if (kind == 0) SendReport(farm);
    if (kind == 1) SendResult(farm);
    if (kind == 2) SendJob(farm);
    if (kind == 3) SendRequest(farm);
    return [] {};
  };
  network_.Call("stranger", serve, [] {});
}

uint64_t Stranger::SomeLease(Farm& farm) {
  const MutexLock lock(&farm.tables().mutex);
  std::vector<uint64_t> ids{0, random_.Bits()};
  for (const auto& [id, worker] : farm.tables().scheduler.workers().workers()) {
    ids.insert(ids.end(), worker.leases.begin(), worker.leases.end());
  }
  return ids[random_.Below(ids.size())];
}

// Never one that proves anything: it may be that of another identity.
std::string Stranger::SomeToken(uint64_t lease_id) {
  const auto stolen = world_.tokens.find(lease_id);
  if (stolen != world_.tokens.end() && random_.Chance(0.4)) return stolen->second;
  return random_.Chance(0.5) ? "" : Sha256Hex(absl::StrCat(random_.Bits())).substr(0, 32);
}

std::string Stranger::SomeWorker(Farm& farm) {
  const MutexLock lock(&farm.tables().mutex);
  std::vector<std::string> ids{absl::StrCat("stranger", random_.Below(2))};
  for (const auto& [id, worker] : farm.tables().scheduler.workers().workers()) ids.push_back(id);
  return ids[random_.Below(ids.size())];
}

std::string Stranger::SomeFrameDigest(Farm& farm) {
  const MutexLock lock(&farm.tables().mutex);
  std::vector<std::string> digests{Sha256Hex("unknown")};
  for (const auto& [id, job] : farm.tables().scheduler.jobs()) {
    for (const auto& frame : job.frames) digests.push_back(frame.Spec().frame_digest);
  }
  return digests[random_.Below(digests.size())];
}

void Stranger::SendReport(Farm& farm) {
  coordinator::WorkerReport report;
  report.worker_id = SomeWorker(farm);
  report.host = "elsewhere";
  report.numeric_profile = random_.Chance(0.5) ? NumericProfile() : "another";
  report.thread_count = static_cast<int32_t>(1 + random_.Below(1000));
  report.requested_lease_count = static_cast<int32_t>(random_.Between(-2, 4));
  report.draining = random_.Chance(0.1);
  for (uint64_t i = random_.Below(3); i > 0; --i) {
    report.leases.push_back(
        {SomeLease(farm), static_cast<coordinator::LeasePhase>(random_.Below(4))});
  }
  if (random_.Chance(0.2)) {
    report.failures.push_back(
        {SomeLease(farm), static_cast<coordinator::FailureKind>(random_.Below(5)), "made up", ""});
  }
  report.warm_scenes = {Sha256Hex("scene 0")};
  const uint64_t failures_before = ReportedFailures(farm);
  if (farm.Synchronize(report).ok()) world_.heard[report.worker_id] = world_.now();
  if (ReportedFailures(farm) != failures_before) {
    world_.Broken("a failure that lacks the proof of its lease is counted");
  }
}

void Stranger::SendResult(Farm& farm) {
  coordinator::ResultReport report;
  report.frame_digest = SomeFrameDigest(farm);
  report.worker_id = SomeWorker(farm);
  report.identity = absl::StrCat("stranger", random_.Below(2));
  report.lease_id = SomeLease(farm);
  report.token = SomeToken(report.lease_id);
  report.tile = {0, 0, random_.Chance(0.5) ? 8 : 16, 8};
  report.block.count = uint64_t{16} << random_.Below(3);
  report.block.first = report.block.count * random_.Below(4);
  if (random_.Chance(0.3)) report.cells = {4, 1 + random_.Below(15)};
  std::string bytes = random_.Chance(0.5) ? "" : std::string(random_.Below(500), 'x');
  if (random_.Chance(0.5)) bytes = TruePart(LeaseOf(report));
  report.digest = {Sha256Hex(bytes), random_.Chance(0.1) ? 7 : bytes.size()};
  const auto outcome = farm.intake().Add(report, bytes);
  if (!absl::IsPermissionDenied(outcome.status())) {
    world_.Broken(
        absl::StrCat("a stranger's result is not refused: ", outcome.status().ToString()));
  }
}

void Stranger::SendJob(Farm& farm) {
  coordinator::JobSpec spec;
  spec.title = "impossible";
  spec.partition.tile_size_px = static_cast<int32_t>(kNumbers[random_.Below(5)]);
  spec.partition.pass_sample_count = kNumbers[random_.Below(std::size(kNumbers))];
  spec.partition.cell_size_px = 5;
  spec.frames.resize(random_.Below(3));
  for (coordinator::FrameSpec& frame : spec.frames) {
    frame.scene = {Sha256Hex("scene 0"), 7};
    frame.settings.window = {0, 0, 16, 16};
    frame.settings.samples = kNumbers[random_.Below(std::size(kNumbers))];
  }
  if (farm.CreateJob(spec, absl::StrCat("stranger ", random_.Below(3))).ok()) {
    world_.Broken("a job that cannot be rendered is taken");
  }
}

void Stranger::SendRequest(Farm& farm) {
  const uint64_t id = 1000 + random_.Below(3);
  if (farm.CancelJob(id).ok() || farm.PauseJob(id).ok() || farm.ResumeJob(id).ok() ||
      farm.SetJobPriority(id, {.priority = INT32_MIN}).ok() ||
      farm.RefineJob(id, {.refinement = {{}, UINT64_MAX}}).ok() ||
      farm.RetryTasks(id, {.task = 7}).ok() || farm.KillTasks(id, {.frame = 0, .task = 3}).ok() ||
      farm.images().Find(id, 0).ok()) {
    world_.Broken("a request about a job that does not exist succeeds");
  }
}

}  // namespace sheaf::sim
