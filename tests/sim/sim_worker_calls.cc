// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The calls of SimWorker: what it sends, how the coordinator answers, and what must hold of that.
#include <optional>
#include <utility>

#include "tests/sim/lies.h"
#include "tests/sim/sim_messages.h"
#include "tests/sim/sim_worker.h"
#include "tests/sim/synthetic_film.h"

namespace sheaf::sim {
namespace {

using coordinator::ResultOutcome;
using worker::FinishedPart;

std::vector<worker::UploadOutcome> WireOutcomes(const std::vector<ResultOutcome>& outcomes) {
  std::vector<worker::UploadOutcome> wire;
  for (const ResultOutcome outcome : outcomes) {
    wire.push_back(static_cast<worker::UploadOutcome>(outcome));
  }
  return wire;
}

}  // namespace

coordinator::WorkerReport SimWorker::MakeReport(const worker::WorkerState& state) const {
  coordinator::WorkerReport report;
  report.worker_id = state.worker_id;
  report.host = state.host;
  report.identity = habits_.identity;
  report.numeric_profile = state.numeric_profile;
  report.thread_count = state.thread_count;
  for (const worker::LeaseReport& lease : state.leases) {
    report.leases.push_back({lease.lease_id, static_cast<coordinator::LeasePhase>(lease.phase)});
  }
  for (const worker::LeaseFailure& failure : state.failures) {
    report.failures.push_back({failure.lease_id,
                               static_cast<coordinator::FailureKind>(failure.kind), failure.message,
                               failure.token});
  }
  report.draining = state.draining;
  report.requested_lease_count = state.requested_lease_count;
  report.warm_scenes = {warm_scenes_.begin(), warm_scenes_.end()};
  return report;
}

void SimWorker::Synchronize() {
  synchronizing_ = true;
  const worker::AgentState::Report report = state_.BeginSynchronize(Now());
  const auto self = shared_from_this();
  const auto reply = [self, sequence = report.sequence](
                         absl::StatusOr<worker::DesiredState> desired) -> Network::Reply {
    return [self, sequence, desired] {
      self->Wake([self, sequence, desired] { self->TakeAnswer(sequence, desired); });
    };
  };
  const auto serve =
      [self, reply, report = MakeReport(report.state)](coordinator::Farm& farm) -> Network::Reply {
    return reply(self->Ask(farm, report));
  };
  network_.Call("synchronize", serve, reply(absl::UnavailableError("no answer")));
}

absl::StatusOr<worker::DesiredState> SimWorker::Ask(coordinator::Farm& farm,
                                                    const coordinator::WorkerReport& report) {
  if (world_.faults.Happens(Fault::kVersionRefused)) {
    return absl::FailedPreconditionError("another version");
  }
  const auto answer = farm.Synchronize(report);
  if (!answer.ok()) {
    world_.Trace(id_, " is refused: ", answer.status().message());
    return answer.status();
  }
  world_.heard[id_] = world_.now();
  worker::DesiredState desired;
  desired.next_synchronize = absl::ToChronoMilliseconds(answer->next_synchronize);
  desired.exit = answer->exits;
  desired.deliveries = world_.offers_deliveries;
  std::string ids;
  for (const coordinator::LeaseGrant& grant : answer->leases) {
    desired.leases.push_back(ToWorkerLease(grant));
    CheckGrant(desired.leases.back());
    absl::StrAppend(&ids, " ", grant.lease.lease_id & 0xffffff);
  }
  world_.Trace(id_, " synchronizes, must hold leases", ids);
  return desired;
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

void SimWorker::TakeAnswer(uint64_t sequence, const absl::StatusOr<worker::DesiredState>& desired) {
  synchronizing_ = false;
  if (desired.ok()) {
    state_.TakeAnswer(sequence, *desired, Now());
  } else {
    state_.TakeNoAnswer(desired.status(), Now());
  }
  Continue();
}

void SimWorker::Upload() {
  if (uploading_ || !state_.HasParts()) return;
  uploading_ = true;
  if (!synchronizing_ && state_.DeliversState()) return Deliver();
  const auto parts = std::make_shared<std::vector<FinishedPart>>();
  for (const FinishedPart* part : state_.NextUpload()) parts->push_back(*part);
  const auto self = shared_from_this();
  const auto serve = [self, parts](coordinator::Farm& farm) -> Network::Reply {
    const auto outcomes = self->AddResults(farm, *parts);
    return [self, outcomes] { self->Wake([self, outcomes] { self->TakeOutcomes(outcomes); }); };
  };
  const absl::Status lost = absl::UnavailableError("no answer");
  network_.Call("upload", serve,
                [self, lost] { self->Wake([self, lost] { self->TakeOutcomes(lost); }); });
}

void SimWorker::Deliver() {
  synchronizing_ = true;
  const auto parts = std::make_shared<std::vector<FinishedPart>>();
  for (const FinishedPart* part : state_.NextUpload()) parts->push_back(*part);
  const worker::AgentState::Report report = state_.BeginDelivery(Now());
  const auto self = shared_from_this();
  const auto reply = [self, sequence = report.sequence](
                         absl::StatusOr<worker::Delivery> delivery) -> Network::Reply {
    return [self, sequence, delivery] {
      self->Wake([self, sequence, delivery] { self->TakeDelivery(sequence, delivery); });
    };
  };
  const auto serve = [self, reply, parts, report = MakeReport(report.state)](
                         coordinator::Farm& farm) -> Network::Reply {
    const auto outcomes = self->AddResults(farm, *parts);
    if (!outcomes.ok()) return reply(outcomes.status());
    auto desired = self->Ask(farm, report);
    if (!desired.ok()) return reply(desired.status());
    return reply(worker::Delivery{WireOutcomes(*outcomes), *std::move(desired)});
  };
  network_.Call("deliver", serve, reply(absl::UnavailableError("no answer")));
}

void SimWorker::TakeDelivery(uint64_t sequence, const absl::StatusOr<worker::Delivery>& delivery) {
  synchronizing_ = false;
  absl::Duration wait;
  if (delivery.ok()) {
    state_.TakeDelivery(sequence, *delivery, Now());
  } else {
    wait = absl::FromChrono(state_.TakeDeliveryFailure(delivery.status()));
  }
  After(wait, [this] {
    uploading_ = false;
    Continue();
  });
  if (!delivery.ok()) Turn();
}

absl::StatusOr<std::vector<ResultOutcome>> SimWorker::AddResults(
    coordinator::Farm& farm, const std::vector<FinishedPart>& parts) {
  const bool was_liar = promises_.IsLiar(identity());
  std::vector<coordinator::ResultReport> reports;
  for (const FinishedPart& part : parts) {
    reports.push_back(ToReport(id_, habits_.identity, part));
    if (world_.faults.Happens(Fault::kUploadCut)) break;
  }
  std::vector<coordinator::ResultIntake::Arrived> arrived;
  for (size_t i = 0; i < reports.size(); ++i) arrived.push_back({&reports[i], &parts[i].exr_bytes});
  promises_.BeginStoring();
  const auto taken = farm.intake().AddGroup(arrived);
  if (world_.machine.disk().stopped()) return absl::UnavailableError("no caller gets this");
  std::vector<ResultOutcome> outcomes;
  for (size_t i = 0; i < taken.size(); ++i) {
    world_.Trace(id_, " uploads the result of lease ", parts[i].lease_id & 0xffffff, ": ",
                 taken[i].ok() ? absl::StrCat("outcome ", static_cast<int>(*taken[i]))
                               : std::string(taken[i].status().message()));
    if (!taken[i].ok()) return taken[i].status();
    CheckOutcome(parts[i], was_liar, *taken[i]);
    outcomes.push_back(*taken[i]);
  }
  if (taken.size() < parts.size()) return absl::CancelledError("cut");
  return outcomes;
}

void SimWorker::CheckOutcome(const FinishedPart& part, bool was_liar, ResultOutcome outcome) {
  const std::string name = absl::StrCat("the result of lease ", part.lease_id, " of ", id_);
  if (was_liar) world_.Broken(absl::StrCat(name, " is taken, although it made false ones"));
  if (outcome != ResultOutcome::kAccepted) return;
  if (!promises_.HasStored(part.digest.sha256_hex)) {
    world_.Broken(absl::StrCat(name, " is acknowledged, but not durable"));
  }
  if (part.exr_bytes == TruePart(LeaseOf(part))) return;
  if (part.exr_bytes == MakeFalseBytes(LeaseOf(part))) return;
  world_.Broken(absl::StrCat(name, " is accepted, but is not of its key"));
}

void SimWorker::TakeOutcomes(const absl::StatusOr<std::vector<ResultOutcome>>& outcomes) {
  absl::Duration wait;
  if (outcomes.ok()) {
    state_.TakeOutcomes(WireOutcomes(*outcomes));
  } else {
    wait = absl::FromChrono(state_.TakeUploadFailure(outcomes.status()));
  }
  After(wait, [this] {
    uploading_ = false;
    Continue();
  });
}

}  // namespace sheaf::sim
