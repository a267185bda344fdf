// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/grpc/wire.h"

#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "common/base/printable.h"
#include "common/rpc/settings_codec.h"

namespace sheaf::coordinator {
namespace {

// The wire has the numbers of stored parts.
static_assert(static_cast<int>(TaskKind::kTraining) == v1::TASK_KIND_TRAINING &&
              v1::TaskKind_ARRAYSIZE == 3);

absl::Status Invalid(const std::string& field, const std::string& why) {
  return absl::InvalidArgumentError(absl::StrCat(field, ": ", why));
}

absl::Status CheckNoControls(const std::string& field, const std::string& text) {
  const size_t at = FindUnprintable(text);
  if (at == std::string::npos) return absl::OkStatus();
  return Invalid(field, absl::StrCat("has a control character at byte ", at, ", \"",
                                     Printable(text), "\"; remove it"));
}

absl::Status CheckText(const std::string& field, const std::string& text, size_t bytes_max) {
  if (text.empty()) return Invalid(field, "is empty");
  if (text.size() > bytes_max) return Invalid(field, absl::StrCat("is over ", bytes_max, " bytes"));
  return CheckNoControls(field, text);
}

Partition FromWire(const v1::Partition& wire) {
  Partition partition;
  if (wire.tile_size_px() != 0) partition.tile_size_px = wire.tile_size_px();
  if (wire.pass_sample_count() != 0) partition.pass_sample_count = wire.pass_sample_count();
  partition.lease_pass_count = wire.lease_pass_count();
  partition.cell_size_px = wire.cell_size_px();
  return partition;
}

absl::StatusOr<absl::Duration> FromWire(const std::string& field,
                                        const google::protobuf::Duration& wire) {
  const absl::Duration duration = absl::Seconds(wire.seconds()) + absl::Nanoseconds(wire.nanos());
  if (duration <= absl::ZeroDuration()) return Invalid(field, "is not positive");
  if (duration > kStopDurationMax) return Invalid(field, "is longer than 100 years");
  return duration;
}

absl::StatusOr<StopRule> FromWire(const v1::StopRule& wire) {
  StopRule rule;
  rule.target_error = wire.target_error();
  if (!(rule.target_error >= 0 && rule.target_error <= kTargetErrorMax)) {
    return Invalid("stop.target_error",
                   absl::StrCat(rule.target_error, " is outside 0 to ", kTargetErrorMax));
  }
  rule.certified = wire.certified();
  if (rule.certified && rule.target_error == 0) {
    return Invalid("stop.certified", "there is no target_error to certify");
  }
  if (wire.has_time_max()) {
    const absl::StatusOr<absl::Duration> time = FromWire("stop.time_max", wire.time_max());
    if (!time.ok()) return time.status();
    rule.time_max = *time;
  }
  if (wire.has_cpu_max()) {
    const absl::StatusOr<absl::Duration> cpu = FromWire("stop.cpu_max", wire.cpu_max());
    if (!cpu.ok()) return cpu.status();
    rule.cpu_max = *cpu;
  }
  return rule;
}

absl::StatusOr<LeasePhase> FromWire(v1::LeaseState::Phase phase) {
  switch (phase) {
    case v1::LeaseState::PHASE_QUEUED:
      return LeasePhase::kQueued;
    case v1::LeaseState::PHASE_LOADING:
      return LeasePhase::kLoading;
    case v1::LeaseState::PHASE_RENDERING:
      return LeasePhase::kRendering;
    case v1::LeaseState::PHASE_UPLOADING:
      return LeasePhase::kUploading;
    default:
      return Invalid("leases.phase", absl::StrCat("unknown value ", static_cast<int>(phase)));
  }
}

absl::StatusOr<FailureKind> FromWire(v1::LeaseFailure::Kind kind) {
  switch (kind) {
    case v1::LeaseFailure::KIND_RELEASED:
      return FailureKind::kReleased;
    case v1::LeaseFailure::KIND_INFRASTRUCTURE:
      return FailureKind::kInfrastructure;
    case v1::LeaseFailure::KIND_SCENE:
      return FailureKind::kScene;
    case v1::LeaseFailure::KIND_MEMORY:
      return FailureKind::kMemory;
    case v1::LeaseFailure::KIND_INTERNAL:
      return FailureKind::kInternal;
    default:
      return Invalid("failures.kind", absl::StrCat("unknown value ", static_cast<int>(kind)));
  }
}

v1::Lease ToWire(const LeaseGrant& grant) {
  v1::Lease wire;
  wire.set_lease_id(grant.lease.lease_id);
  wire.set_attempt(grant.lease.attempt);
  wire.set_frame_name(FrameName(grant.lease.frame));
  wire.mutable_key()->set_frame_digest(grant.frame_digest);
  *wire.mutable_key()->mutable_tile() = ToWire(grant.lease.tile_rect);
  wire.mutable_key()->mutable_block()->set_first(grant.lease.task.block.first);
  wire.mutable_key()->mutable_block()->set_count(grant.lease.task.block.count);
  wire.mutable_key()->set_cell_size_px(grant.lease.cells.size_px);
  wire.mutable_key()->set_cells(grant.lease.cells.mask);
  wire.mutable_key()->set_kind(static_cast<v1::TaskKind>(grant.lease.kind));
  *wire.mutable_scene() = coordinator::ToWire(grant.scene);
  *wire.mutable_settings() = ToWire(grant.settings);
  wire.set_token(grant.token);
  if (!grant.lease.field.sha256_hex.empty()) {
    *wire.mutable_guiding_field() = coordinator::ToWire(grant.lease.field);
  }
  return wire;
}

}  // namespace

absl::StatusOr<JobSpec> FromWire(const v1::CreateJobRequest& request) {
  absl::Status status = CheckText("request_id", request.request_id(), kRequestIdBytesMax);
  if (status.ok()) status = CheckText("title", request.title(), kTitleBytesMax);
  if (!status.ok()) return status;
  JobSpec spec;
  spec.pilot = request.pilot();
  spec.title = request.title();
  if (request.command().size() > kCommandBytesMax) {
    return Invalid("command", absl::StrCat("has more than ", kCommandBytesMax, " bytes"));
  }
  spec.command = Printable(request.command(), kCommandBytesMax);
  spec.priority = request.priority();
  if (status = ReadSharing(request, &spec); !status.ok()) return status;
  spec.partition = FromWire(request.partition());
  spec.frames.reserve(static_cast<size_t>(request.frames_size()));
  for (const v1::FrameSpec& wire : request.frames()) {
    absl::StatusOr<BlobDigest> scene = FromWire(wire.scene());
    if (!scene.ok()) return Invalid("frames.scene", std::string(scene.status().message()));
    absl::StatusOr<FrameSettings> settings = sheaf::FromWire(wire.settings());
    if (!settings.ok()) return Invalid("frames.settings", std::string(settings.status().message()));
    absl::StatusOr<StopRule> stop = FromWire(wire.stop());
    if (!stop.ok()) return stop.status();
    FrameSpec frame;
    if (wire.has_resumed_image()) {
      absl::StatusOr<BlobDigest> resumed = FromWire(wire.resumed_image());
      if (!resumed.ok()) {
        return Invalid("frames.resumed_image", std::string(resumed.status().message()));
      }
      frame.resumed = *std::move(resumed);
    }
    frame.stop = *stop;
    frame.frame_number = wire.frame_number();
    frame.scene = *std::move(scene);
    frame.settings = *std::move(settings);
    spec.frames.push_back(std::move(frame));
  }
  if (absl::Status held = TakeHolds(request, &spec); !held.ok()) return held;
  if (absl::Status due = ReadDeadline(request, &spec); !due.ok()) return due;
  if (request.effect_costs_size() > kEffectCostsMax) {
    return Invalid("effect_costs", absl::StrCat("more than ", kEffectCostsMax));
  }
  for (const v1::EffectCost& wire : request.effect_costs()) {
    absl::StatusOr<EffectCost> effect = FromWire(wire);
    if (!effect.ok()) return effect.status();
    spec.effect_costs.push_back(*std::move(effect));
  }
  return spec;
}

absl::StatusOr<Refinement> FromWire(const v1::RefineJobRequest& request) {
  const absl::StatusOr<StopRule> stop = FromWire(request.stop());
  if (!stop.ok()) return stop.status();
  return Refinement{*stop, request.sample_count()};
}

absl::StatusOr<WorkerReport> FromWire(const v1::SynchronizeRequest& request) {
  absl::Status status = CheckText("worker_id", request.worker_id(), kWorkerTextBytesMax);
  if (status.ok()) status = CheckText("host", request.host(), kWorkerTextBytesMax);
  if (status.ok()) {
    status = CheckText("numeric_profile", request.numeric_profile(), kWorkerTextBytesMax);
  }
  if (!status.ok()) return status;
  if (request.leases_size() > kLeaseReportsMax || request.failures_size() > kLeaseReportsMax) {
    return Invalid("leases", absl::StrCat("more than ", kLeaseReportsMax));
  }
  if (request.thread_count() < 1) return Invalid("thread_count", "is not positive");
  WorkerReport report;
  report.worker_id = request.worker_id();
  report.host = request.host();
  report.numeric_profile = request.numeric_profile();
  report.thread_count = request.thread_count();
  report.requested_lease_count = request.requested_lease_count();
  report.draining = request.draining();
  for (const std::string& scene : request.warm_scenes()) {
    if (!IsSha256Hex(scene)) return Invalid("warm_scenes", "has an entry that is not a SHA-256");
    report.warm_scenes.push_back(scene);
  }
  report.scene_memory_bytes = request.scene_memory_bytes();
  if (status = ReadTraits(request, &report.traits); !status.ok()) return status;
  for (const v1::LeaseState& lease : request.leases()) {
    const absl::StatusOr<LeasePhase> phase = FromWire(lease.phase());
    if (!phase.ok()) return phase.status();
    report.leases.push_back({lease.lease_id(), *phase});
  }
  for (const v1::LeaseFailure& failure : request.failures()) {
    const absl::StatusOr<FailureKind> kind = FromWire(failure.kind());
    if (!kind.ok()) return kind.status();
    std::string text = Printable(failure.message(), kFailureTextBytesMax);
    const v1::CacheShortage& lacks = failure.cache_shortage();
    report.failures.push_back({failure.lease_id(), *kind, text, failure.token(),
                               lacks.needed_bytes(), lacks.room_bytes()});
  }
  return report;
}

absl::StatusOr<ResultReport> FromWire(const v1::ResultHeader& header) {
  ResultReport report;
  report.frame_digest = header.key().frame_digest();
  if (!IsSha256Hex(report.frame_digest)) return Invalid("key.frame_digest", "is not a SHA-256");
  report.tile = sheaf::FromWire(header.key().tile());
  report.block = {header.key().block().first(), header.key().block().count()};
  if (!IsAligned(report.block)) return Invalid("key.block", "is not an aligned power of two");
  report.cells = {header.key().cell_size_px(), header.key().cells()};
  const std::string why_no_cells = WhyNoCells(report.tile, report.cells);
  if (!why_no_cells.empty()) return Invalid("key.cells", why_no_cells);
  if (!v1::TaskKind_IsValid(header.key().kind())) return Invalid("key.kind", "is unknown");
  report.kind = static_cast<TaskKind>(header.key().kind());
  if (header.has_guiding_field()) {
    absl::StatusOr<BlobDigest> field = FromWire(header.guiding_field());
    if (!field.ok()) return Invalid("guiding_field", std::string(field.status().message()));
    report.field = field->sha256_hex;
  }
  report.lease_id = header.lease_id();
  report.token = header.token();
  report.is_stored = header.stored();
  report.worker_id = header.worker_id();
  absl::Status named = CheckText("worker_id", report.worker_id, kWorkerTextBytesMax);
  if (!named.ok()) return named;
  absl::StatusOr<BlobDigest> digest = FromWire(header.digest());
  if (!digest.ok()) return Invalid("digest", std::string(digest.status().message()));
  report.digest = *std::move(digest);
  report.ray_count = header.ray_count();
  report.cpu_duration = absl::Seconds(header.cpu_duration().seconds()) +
                        absl::Nanoseconds(header.cpu_duration().nanos());
  if (report.cpu_duration < absl::ZeroDuration()) return Invalid("cpu_duration", "is negative");
  if (report.cpu_duration > kResultCpuMax)
    return Invalid("cpu_duration", "is longer than 100 years");
  if (report.ray_count > kResultRaysMax) {
    return Invalid("ray_count", absl::StrCat("is larger than ", kResultRaysMax));
  }
  return report;
}

v1::SynchronizeResponse ToWire(const Farm::SynchronizeAnswer& answer) {
  v1::SynchronizeResponse wire;
  for (const LeaseGrant& grant : answer.leases) *wire.add_leases() = ToWire(grant);
  SetDuration(answer.next_synchronize, wire.mutable_next_synchronize_duration());
  SetDuration(answer.lease_duration, wire.mutable_lease_duration());
  wire.set_exit(answer.exits);
  wire.set_direct_uploads(answer.direct_uploads);
  // Workers send nothing but headers where they store results themselves.
  wire.set_deliveries(!answer.direct_uploads);
  return wire;
}

}  // namespace sheaf::coordinator
