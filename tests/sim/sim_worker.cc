// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/sim/sim_worker.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "common/base/digest.h"
#include "tests/sim/sim_messages.h"
#include "tests/sim/synthetic_film.h"

namespace sheaf::sim {
namespace {

using coordinator::ResultOutcome;
using worker::FailureKind;
using worker::FinishedPart;
using worker::LeaseLedger;
using worker::LeasePhase;

constexpr uint64_t kUnsentBytesMax = uint64_t{1} << 17;  // A few parts: the limit is met.
constexpr size_t kUploadPartsMax = 4;
constexpr int32_t kLeasesAhead = 2;
constexpr absl::Duration kBackoffMin = absl::Milliseconds(100), kBackoffMax = absl::Seconds(3);
constexpr absl::Duration kSynchronizeSpacing = absl::Milliseconds(5);
constexpr absl::Duration kLoadMin = absl::Milliseconds(10), kLoadMax = absl::Seconds(2);
constexpr absl::Duration kRenderMin = absl::Milliseconds(20), kRenderMax = absl::Seconds(3);
constexpr double kSampleCpuSeconds = 1e-4;

}  // namespace

SimWorker::SimWorker(World* world, Network* network, const Promises* promises, std::string id,
                     const Habits& habits)
    : world_(*world),
      network_(*network),
      promises_(*promises),
      id_(std::move(id)),
      habits_(habits),
      outbox_(kUnsentBytesMax),
      backoff_(kBackoffMin),
      upload_backoff_(kBackoffMin),
      upload_parts_max_(kUploadPartsMax) {}

void SimWorker::After(absl::Duration delay, std::function<void()> run) {
  world_.After(delay, [self = shared_from_this(), run = std::move(run)]() mutable {
    self->Wake(std::move(run));
  });
}

void SimWorker::Wake(std::function<void()> run) {
  if (!alive_) return;
  const absl::Duration frozen = frozen_until_ - world_.now();
  if (frozen > absl::ZeroDuration()) {
    After(frozen, std::move(run));
  } else {
    run();
  }
}

void SimWorker::Freeze(absl::Duration time) { frozen_until_ = world_.now() + time; }

void SimWorker::Drain() {
  if (habits_.hoards) return Kill();
  draining_ = true;
  ledger_.ReleaseQueued();
  NoteNews();
}

void SimWorker::EndIfDone() {
  if (!draining_ || !ledger_.Empty() || !outbox_.empty() || news_) return;
  world_.Trace(id_, " has ended in order");
  alive_ = false;
}

void SimWorker::ScheduleSynchronize(absl::Duration delay) {
  After(delay, [this, timer = ++timer_] {
    if (timer == timer_ && !synchronizing_) Synchronize();
  });
}

void SimWorker::NoteNews() {
  news_ = true;
  if (!synchronizing_) ScheduleSynchronize(kSynchronizeSpacing);
}

coordinator::WorkerReport SimWorker::MakeReport(const LeaseLedger::Snapshot& snapshot) const {
  coordinator::WorkerReport report;
  report.worker_id = report.host = id_;
  report.identity = habits_.identity;
  report.numeric_profile = NumericProfile();
  report.thread_count = habits_.thread_count;
  for (const worker::LeaseReport& lease : snapshot.leases) {
    report.leases.push_back({lease.lease_id, static_cast<coordinator::LeasePhase>(lease.phase)});
  }
  for (const worker::LeaseFailure& failure : snapshot.failures) {
    report.failures.push_back({failure.lease_id,
                               static_cast<coordinator::FailureKind>(failure.kind), failure.message,
                               failure.token});
  }
  report.draining = draining_;
  if (!draining_) {
    report.requested_lease_count =
        habits_.thread_count + kLeasesAhead + ledger_.CountHeld(LeasePhase::kUploading);
  }
  report.warm_scenes = {warm_scenes_.begin(), warm_scenes_.end()};
  return report;
}

void SimWorker::Synchronize() {
  synchronizing_ = true;
  news_ = false;
  const LeaseLedger::Snapshot snapshot = ledger_.TakeSnapshot();
  const auto self = shared_from_this();
  const auto serve = [self, sequence = snapshot.sequence,
                      report = MakeReport(snapshot)](coordinator::Farm& farm) -> Network::Reply {
    const auto answer = farm.Synchronize(report);
    if (!answer.ok()) {
      self->world_.Trace(self->id_, " is refused: ", answer.status().message());
      return [self] {
        self->Wake([self] {
          self->synchronizing_ = false;
          self->ScheduleSynchronize(kBackoffMax);
        });
      };
    }
    self->world_.heard[self->id_] = self->world_.now();
    std::vector<worker::Lease> leases;
    std::string ids;
    for (const coordinator::LeaseGrant& grant : answer->leases) {
      leases.push_back(ToWorkerLease(grant));
      self->CheckGrant(leases.back());
      absl::StrAppend(&ids, " ", grant.lease.lease_id & 0xffffff);
    }
    self->world_.Trace(self->id_, " synchronizes, shall hold leases", ids);
    return [self, sequence, leases, next = answer->next_synchronize] {
      self->Wake([=] { self->TakeAnswer(sequence, leases, next); });
    };
  };
  network_.Call("synchronize", serve, [self] {
    self->Wake([self] {
      self->synchronizing_ = false;
      self->news_ = true;
      self->ScheduleSynchronize(self->backoff_);
      self->backoff_ = std::min(self->backoff_ * 2, kBackoffMax);
    });
  });
}

void SimWorker::CheckGrant(const worker::Lease& lease) {
  const std::string task = absl::StrCat(
      id_, " ", lease.frame_digest, " ", lease.tile.x0, " ", lease.tile.y0, " ", lease.block.first,
      " ", lease.block.count, " ", lease.cells.mask, " ", TaskKindName(lease.kind));
  world_.tokens[lease.lease_id] = lease.token;
  const bool needs_field =
      NeedsTraining(lease.settings.techniques) && lease.kind != TaskKind::kTraining;
  if (needs_field != !lease.field.sha256_hex.empty()) {
    world_.Broken(absl::StrCat("lease ", lease.lease_id, needs_field ? " lacks its" : " has a",
                               " guiding field"));
  }
  const auto [granted, is_new] = world_.granted.emplace(lease.lease_id, task);
  if (!is_new && granted->second != task) {
    world_.Broken(absl::StrCat("lease ", lease.lease_id, " stands for two tasks"));
  }
}

void SimWorker::TakeAnswer(uint64_t sequence, const std::vector<worker::Lease>& leases,
                           absl::Duration next_synchronize) {
  synchronizing_ = false;
  backoff_ = kBackoffMin;
  ledger_.Apply(sequence, leases);
  if (draining_ && ledger_.HasQueued()) {
    ledger_.ReleaseQueued();
    news_ = true;
  }
  ScheduleSynchronize(news_ ? kSynchronizeSpacing : next_synchronize);
  TakeWork();
  EndIfDone();
}

void SimWorker::Hoard() {
  while (const std::optional<LeaseLedger::Task> task = ledger_.TakeNext()) {
    ledger_.BeginRendering(task->lease.lease_id);
    NoteNews();
  }
}

void SimWorker::TakeWork() {
  if (habits_.hoards) return Hoard();
  while (busy_threads_ < habits_.thread_count && outbox_.HasRoom()) {
    const std::optional<LeaseLedger::Task> task = ledger_.TakeNext();
    if (!task) return;
    ++busy_threads_;
    const bool is_warm = warm_scenes_.contains(task->lease.scene.sha256_hex);
    if (!is_warm) NoteNews();  // It may be the last that is heard of this worker.
    const absl::Duration load = world_.random.Between(kLoadMin, kLoadMax) * habits_.slowness;
    After(is_warm ? absl::ZeroDuration() : load, [this, task = *task] { Load(task); });
  }
}

void SimWorker::Load(const LeaseLedger::Task& task) {
  const uint64_t id = task.lease.lease_id;
  if (task.stop.stop_requested()) return FailTask(id, FailureKind::kReleased);
  if (world_.poisoned_scenes.contains(task.lease.scene.sha256_hex)) {
    return FailTask(id, FailureKind::kInternal);
  }
  warm_scenes_.insert(task.lease.scene.sha256_hex);
  if (world_.faults.Happens(Fault::kTaskFailed)) {
    Random& random = world_.faults.random(Fault::kTaskFailed);
    return FailTask(id, static_cast<FailureKind>(random.Below(5)));
  }
  if (task.lease.field.sha256_hex.empty() || fields_.contains(task.lease.field.sha256_hex)) {
    BeginRendering(task);
  } else {
    FetchField(task);
  }
}

void SimWorker::FetchField(const LeaseLedger::Task& task) {
  const auto self = shared_from_this();
  const auto serve = [self, task](coordinator::Farm& farm) -> Network::Reply {
    const absl::StatusOr<std::string> field =
        farm.ReadGuidingField(FrameOf(task.lease), task.lease.field);
    self->world_.Trace(self->id_, " reads a field: ", field.status().ToString());
    if (field.ok() && Sha256Hex(*field) != task.lease.field.sha256_hex) {
      self->world_.Broken("a guiding field has other bytes than its digest says");
    }
    return [self, task, status = field.status()] {
      self->Wake([self, task, status] {
        const uint64_t lease_id = task.lease.lease_id;
        if (absl::IsNotFound(status)) return self->FailTask(lease_id, FailureKind::kReleased);
        if (!status.ok()) return self->FailTask(lease_id, FailureKind::kInfrastructure);
        self->fields_.insert(task.lease.field.sha256_hex);
        self->BeginRendering(task);
      });
    };
  };
  network_.Call("field", serve, [self, task] {
    self->Wake([self, task] { self->FailTask(task.lease.lease_id, FailureKind::kInfrastructure); });
  });
}

void SimWorker::BeginRendering(const LeaseLedger::Task& task) {
  const uint64_t id = task.lease.lease_id;
  if (task.stop.stop_requested()) return FailTask(id, FailureKind::kReleased);
  ledger_.BeginRendering(id);
  const absl::Duration time = world_.random.Between(kRenderMin, kRenderMax) * habits_.slowness;
  After(time, [this, task] { Render(task); });
}

void SimWorker::FailTask(uint64_t lease_id, FailureKind kind) {
  world_.Trace(id_, " fails lease ", lease_id & 0xffffff, ", kind ", static_cast<int>(kind));
  --busy_threads_;
  ledger_.Fail(lease_id, kind, "simulated");
  NoteNews();
  TakeWork();
}

void SimWorker::Render(const LeaseLedger::Task& task) {
  const uint64_t id = task.lease.lease_id;
  if (task.stop.stop_requested()) return FailTask(id, FailureKind::kReleased);
  --busy_threads_;
  FinishedPart part = MakePart(task.lease);
  if (habits_.lies && world_.faults.Happens(Fault::kWorkerLies)) Lie(&part);
  ledger_.Finish(id);
  outbox_.Push(std::move(part));
  NoteNews();
  Upload();
  TakeWork();
}

FinishedPart SimWorker::MakePart(const worker::Lease& lease) {
  FinishedPart part;
  part.lease_id = lease.lease_id;
  part.frame_digest = lease.frame_digest;
  part.tile = lease.tile;
  part.block = lease.block;
  part.cells = lease.cells;
  part.kind = lease.kind;
  part.token = lease.token;
  part.field = lease.field;
  if (habits_.makes_false_pixels && world_.faults.Happens(Fault::kFalsePixels)) {
    world_.Trace(id_, " renders false pixels for lease ", lease.lease_id & 0xffffff);
    part.exr_bytes = MakeFalseBytes(lease);
    part.digest = {Sha256Hex(part.exr_bytes), part.exr_bytes.size()};
    world_.false_parts.insert(part.digest.sha256_hex);
    NoteFalse(part);
  } else {
    part.exr_bytes = TruePart(lease);
    part.digest = {Sha256Hex(part.exr_bytes), part.exr_bytes.size()};
  }
  part.ray_count = lease.block.count;
  part.cpu_seconds = static_cast<double>(lease.block.count) * kSampleCpuSeconds;
  return part;
}

std::string SimWorker::MakeFalseBytes(const worker::Lease& lease) const {
  return FalsePart(lease, static_cast<uint64_t>(id_.back()) % 2);
}

void SimWorker::Lie(FinishedPart* part) {
  Random& random = world_.faults.random(Fault::kWorkerLies);
  uint64_t kind = random.Below(8);
  // A field of false bytes looks right: it is no lie that is noticed at once (makes_false_pixels).
  if (part->kind == TaskKind::kTraining && kind > 3 && kind != 5) kind = 3;
  world_.Trace(id_, " lies about lease ", part->lease_id & 0xffffff, ", kind ", kind);
  worker::Lease other = LeaseOf(*part);
  switch (kind) {
    case 0:
      part->block.first += part->block.count;
      break;
    case 1:
      part->tile.x0 += part->tile.Width();
      part->tile.x1 = part->tile.x0 + 8;
      break;
    case 2:
      part->frame_digest = Sha256Hex(part->frame_digest);
      break;
    case 3:
      part->exr_bytes[part->exr_bytes.size() / 2] ^= 1;  // Not of its digest.
      return;
    case 4:
      part->exr_bytes.resize(part->exr_bytes.size() / 2);
      break;
    case 5:
      part->exr_bytes = ImpossiblePart(other);
      break;
    case 6:
      other.block.first += other.block.first == 0 ? other.block.count : -other.block.count;
      part->exr_bytes = TruePart(other);
      break;
    default:
      other.tile.x0 += 8;
      other.tile.x1 += 8;
      part->exr_bytes = TruePart(other);
  }
  part->digest = {Sha256Hex(part->exr_bytes), part->exr_bytes.size()};
  NoteFalse(*part);
}

void SimWorker::NoteFalse(const FinishedPart& part) {
  const std::string result =
      absl::StrCat(part.frame_digest, " ", part.tile.x0, " ", part.tile.y0, " ", part.block.first,
                   " ", part.block.count, " ", part.cells.mask, " ", TaskKindName(part.kind), " ",
                   part.digest.sha256_hex);
  world_.false_results[result].insert(identity());
}

void SimWorker::Upload() {
  if (uploading_ || outbox_.empty()) return;
  uploading_ = true;
  const auto parts = std::make_shared<std::vector<FinishedPart>>();
  for (const FinishedPart* part : outbox_.Front(upload_parts_max_)) parts->push_back(*part);
  const auto self = shared_from_this();
  const auto serve = [self, parts](coordinator::Farm& farm) -> Network::Reply {
    const auto outcomes = self->AddResults(farm, *parts);
    return [self, outcomes, count = parts->size()] {
      self->Wake([=] { self->TakeOutcomes(outcomes, count); });
    };
  };
  network_.Call("upload", serve, [self] { self->Wake([self] { self->RetryUpload(); }); });
}

absl::StatusOr<std::vector<ResultOutcome>> SimWorker::AddResults(
    coordinator::Farm& farm, const std::vector<FinishedPart>& parts) {
  std::vector<ResultOutcome> outcomes;
  for (const FinishedPart& part : parts) {
    const bool was_liar = promises_.IsLiar(identity());
    const absl::StatusOr<ResultOutcome> outcome =
        farm.AddResult(ToReport(id_, habits_.identity, part), part.exr_bytes);
    world_.Trace(id_, " uploads the result of lease ", part.lease_id & 0xffffff, ": ",
                 outcome.ok() ? absl::StrCat("outcome ", static_cast<int>(*outcome))
                              : std::string(outcome.status().message()));
    if (world_.machine.disk().stopped()) return absl::UnavailableError("nobody hears this");
    if (!outcome.ok()) return outcome.status();
    CheckOutcome(part, was_liar, *outcome);
    outcomes.push_back(*outcome);
    if (world_.faults.Happens(Fault::kUploadCut)) return absl::CancelledError("cut");
  }
  return outcomes;
}

void SimWorker::CheckOutcome(const FinishedPart& part, bool was_liar, ResultOutcome outcome) {
  const std::string name = absl::StrCat("the result of lease ", part.lease_id, " of ", id_);
  if (was_liar) world_.Broken(absl::StrCat(name, " is taken, although it made false ones"));
  if (outcome != ResultOutcome::kAccepted) return;
  if (!promises_.HasPart(part.digest.sha256_hex)) {
    world_.Broken(absl::StrCat(name, " is acknowledged, but not durable"));
  }
  if (part.exr_bytes == TruePart(LeaseOf(part))) return;
  if (part.exr_bytes == MakeFalseBytes(LeaseOf(part))) return;
  world_.Broken(absl::StrCat(name, " is accepted, but is not of its key"));
}

void SimWorker::TakeOutcomes(const absl::StatusOr<std::vector<ResultOutcome>>& outcomes,
                             size_t part_count) {
  const bool refused =
      absl::IsInvalidArgument(outcomes.status()) || absl::IsPermissionDenied(outcomes.status());
  if (!outcomes.ok() && !refused) return RetryUpload();
  uploading_ = false;
  upload_backoff_ = kBackoffMin;
  if (outcomes.ok()) {
    upload_parts_max_ = kUploadPartsMax;
    for (size_t i = 0; i < part_count; ++i) {
      ledger_.Acknowledge(outbox_.Front(1).front()->lease_id);
      outbox_.Pop();
    }
  } else if (part_count > 1) {
    upload_parts_max_ = 1;  // One of them is invalid; find it.
  } else {
    ledger_.Fail(outbox_.Front(1).front()->lease_id, FailureKind::kInternal, "refused");
    outbox_.Pop();
  }
  NoteNews();
  Upload();
  TakeWork();
}

void SimWorker::RetryUpload() {
  After(upload_backoff_, [this] {
    uploading_ = false;
    Upload();
  });
  upload_backoff_ = std::min(upload_backoff_ * 2, kBackoffMax);
}

}  // namespace sheaf::sim
