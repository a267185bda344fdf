// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/sim/sim_worker.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "common/base/digest.h"
#include "tests/sim/lies.h"
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
// Short enough that tasks outlast it.
constexpr std::chrono::seconds kGrace{1};
// A call may be lost before the worker sees that it is to leave, and another at the end of its
// grace period (Network has their deadline).
constexpr absl::Duration kLostCallsMax = absl::Seconds(21);
constexpr absl::Duration kLoadMin = absl::Milliseconds(10), kLoadMax = absl::Seconds(2);
constexpr absl::Duration kRenderMin = absl::Milliseconds(20), kRenderMax = absl::Seconds(3);
constexpr double kSampleCpuSeconds = 1e-4;

worker::AgentOptions OptionsOf(const std::string& id, const SimWorker::Habits& habits) {
  worker::AgentOptions options;
  options.worker_id = options.host = id;
  options.numeric_profile = NumericProfile();
  options.thread_count = habits.thread_count;
  options.unsent_bytes_max = kUnsentBytesMax;
  options.grace = kGrace;
  return options;
}

}  // namespace

SimWorker::SimWorker(World* world, Network* network, Promises* promises, std::string id,
                     const Habits& habits)
    : world_(*world),
      network_(*network),
      promises_(*promises),
      id_(std::move(id)),
      habits_(habits),
      state_(OptionsOf(id_, habits), Now()) {}

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

void SimWorker::Freeze(absl::Duration time) {
  frozen_until_ = world_.now() + time;
  awake_at_ = std::max(awake_at_, frozen_until_);
}

void SimWorker::GoAway(absl::Duration time) {
  if (habits_.hoards || stop_requested_) return;
  state_.SetAwayReason("its owner is there");
  leaves_at_ = std::min(leaves_at_, world_.now());
  After(time, [this, absence = ++absence_] {
    if (absence == absence_) ComeBack();
  });
  Wake([this] { Continue(); });
}

void SimWorker::ComeBack() {
  if (stop_requested_) return;
  state_.SetAwayReason("");
  leaves_at_ = absl::InfiniteDuration();
  Wake([this] { Continue(); });
}

void SimWorker::Drain() {
  if (habits_.hoards) return Kill();
  if (stop_requested_) return;
  stop_requested_ = true;
  leaves_at_ = std::min(leaves_at_, world_.now());
  stopped_at_ = world_.now();
  ExpectEnd();
  Wake([this] { Continue(); });
}

void SimWorker::ExpectEnd() {
  const worker::AgentOptions options = OptionsOf(id_, habits_);
  const absl::Duration end = std::max(stopped_at_, awake_at_) + kLostCallsMax +
                             absl::FromChrono(options.grace + 2 * options.farewell);
  if (world_.now() > end) {
    world_.Broken(absl::StrCat(id_, " has not ended, long after it was told to stop"));
  } else {
    After(end - world_.now() + absl::Milliseconds(1), [this] { ExpectEnd(); });
  }
}

bool SimWorker::IsGraceOver() const {
  return world_.now() > std::max(leaves_at_, awake_at_) + absl::FromChrono(kGrace) + kLostCallsMax;
}

worker::AgentState::Time SimWorker::Now() const {
  return worker::AgentState::Time(absl::ToChronoNanoseconds(world_.now()));
}

void SimWorker::ScheduleTurn(absl::Duration delay) {
  After(delay, [this, timer = ++timer_] {
    if (timer == timer_) Turn();
  });
}

void SimWorker::Turn() {
  if (synchronizing_) return;
  state_.Advance(Now(), stop_requested_);
  if (state_.stage() == worker::AgentState::Stage::kDone) return CheckEnd();
  if (state_.MustSynchronize(Now())) return Synchronize();
  ScheduleTurn(std::max(absl::FromChrono(state_.NextTurn() - Now()), absl::ZeroDuration()));
}

void SimWorker::Continue() {
  Turn();
  if (!alive_) return;
  Upload();
  TakeWork();
}

void SimWorker::CheckEnd() {
  alive_ = false;
  world_.Trace(id_, state_.IsComplete() ? " has ended in order" : " has ended with leases");
  if (!state_.IsComplete() && world_.now() < stopped_at_ + absl::FromChrono(kGrace)) {
    world_.Broken(absl::StrCat(id_, " ends with leases before its grace period is over"));
  }
}

void SimWorker::Hoard() {
  while (const std::optional<LeaseLedger::Task> task = state_.TakeTask()) {
    state_.BeginRendering(task->lease.lease_id);
    state_.ReportLoading();
  }
}

void SimWorker::TakeWork() {
  if (habits_.hoards) return Hoard();
  while (busy_threads_ < habits_.thread_count) {
    const std::optional<LeaseLedger::Task> task = state_.TakeTask();
    if (!task) return;
    if (state_.stage() != worker::AgentState::Stage::kWorking) {
      world_.Broken(absl::StrCat(id_, " begins a task, although it is away or stops"));
    }
    ++busy_threads_;
    const bool is_warm = warm_scenes_.contains(task->lease.scene.sha256_hex);
    if (!is_warm) state_.ReportLoading();  // It may be the last that is heard of this worker.
    const absl::Duration load = world_.random.Between(kLoadMin, kLoadMax) * habits_.slowness;
    After(is_warm ? absl::ZeroDuration() : load, [this, task = *task] { Load(task); });
    Turn();
  }
}

bool SimWorker::EndIfStopped(const LeaseLedger::Task& task) {
  const bool stopped = task.stop.stop_requested();
  const bool releases = state_.stage() == worker::AgentState::Stage::kReleasing;
  if (!stopped && (releases || IsGraceOver())) {
    world_.Broken(absl::StrCat(id_, " renders after its grace period"));
  }
  if (stopped) FailTask(task.lease.lease_id, FailureKind::kReleased);
  return stopped;
}

void SimWorker::Load(const LeaseLedger::Task& task) {
  const uint64_t id = task.lease.lease_id;
  if (EndIfStopped(task)) return;
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
        farm.intake().ReadField(FrameOf(task.lease), task.lease.field);
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
  if (EndIfStopped(task)) return;
  state_.BeginRendering(id);
  const absl::Duration time = world_.random.Between(kRenderMin, kRenderMax) * habits_.slowness;
  After(time, [this, task] { Render(task); });
}

void SimWorker::FailTask(uint64_t lease_id, FailureKind kind) {
  world_.Trace(id_, " fails lease ", lease_id & 0xffffff, ", kind ", static_cast<int>(kind));
  --busy_threads_;
  const bool is_returned = kind == FailureKind::kReleased;
  state_.Fail(lease_id, kind,
              is_returned ? absl::CancelledError("stopped") : absl::InternalError("simulated"));
  Continue();
}

void SimWorker::Render(const LeaseLedger::Task& task) {
  if (EndIfStopped(task)) return;
  --busy_threads_;
  FinishedPart part = MakePart(task.lease);
  if (habits_.lies && world_.faults.Happens(Fault::kWorkerLies)) Lie(&part);
  state_.Finish(std::move(part));
  Continue();
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
  uint64_t kind = world_.faults.random(Fault::kWorkerLies).Below(kLieKinds);
  // A field of false bytes looks right: it is no lie that is noticed at once (makes_false_pixels).
  if (part->kind == TaskKind::kTraining && kind > 3 && kind != 5) kind = kLieAboutDigest;
  world_.Trace(id_, " lies about lease ", part->lease_id & 0xffffff, ", kind ", kind);
  Falsify(kind, part);
  if (kind != kLieAboutDigest) NoteFalse(*part);
}

void SimWorker::NoteFalse(const FinishedPart& part) {
  const std::string result =
      absl::StrCat(part.frame_digest, " ", part.tile.x0, " ", part.tile.y0, " ", part.block.first,
                   " ", part.block.count, " ", part.cells.mask, " ", TaskKindName(part.kind), " ",
                   part.digest.sha256_hex);
  world_.false_results[result].insert(identity());
}

}  // namespace sheaf::sim
