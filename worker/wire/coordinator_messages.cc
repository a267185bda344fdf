// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/wire/coordinator_messages.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "common/base/status.h"
#include "common/rpc/settings_codec.h"
#include "worker/wire/lease_codec.h"

namespace sheaf::worker {
namespace {

constexpr int32_t kFrameEdgePxMax = 1 << 16;
// Bounds on the coordinator's values, so that an error there cannot cause a busy loop here.
constexpr std::chrono::milliseconds kNextSynchronizeMin{1};
constexpr std::chrono::milliseconds kNextSynchronizeMax{60'000};

v1::LeaseState::Phase ToWire(LeasePhase phase) {
  switch (phase) {
    case LeasePhase::kQueued:
      return v1::LeaseState::PHASE_QUEUED;
    case LeasePhase::kLoading:
      return v1::LeaseState::PHASE_LOADING;
    case LeasePhase::kRendering:
      return v1::LeaseState::PHASE_RENDERING;
    case LeasePhase::kUploading:
      return v1::LeaseState::PHASE_UPLOADING;
  }
  return v1::LeaseState::PHASE_UNSPECIFIED;
}

absl::Status CheckLease(const Lease& lease) {
  const FrameSettings& settings = lease.settings;
  const PixelRect frame{0, 0, settings.width_px, settings.height_px};
  if (frame.x1 < 1 || frame.y1 < 1 || frame.x1 > kFrameEdgePxMax || frame.y1 > kFrameEdgePxMax) {
    return absl::InvalidArgumentError("the frame's size is beyond the limits");
  }
  if (lease.tile.IsEmpty() || !settings.window.Contains(lease.tile) ||
      !frame.Contains(settings.window)) {
    return absl::InvalidArgumentError("tile and window do not lie within the frame");
  }
  if (!IsAligned(lease.block) || lease.block.End() < lease.block.first ||
      lease.block.End() > settings.samples) {
    return absl::InvalidArgumentError(
        "its samples are not an aligned block of the frame's samples");
  }
  const std::string why_no_cells = WhyNoCells(lease.tile, lease.cells);
  if (!why_no_cells.empty())
    return absl::InvalidArgumentError("its cells are invalid: " + why_no_cells);
  if (lease.kind == TaskKind::kLight) {
    const bool fits = HasLightPaths(settings.techniques) && lease.tile == settings.window &&
                      lease.cells.All() && settings.lattice.All();
    if (!fits) return absl::InvalidArgumentError("its light passes are not those of its frame");
  }
  if (lease.kind == TaskKind::kTraining) {
    const bool fits = NeedsTraining(settings.techniques) && lease.tile == settings.window &&
                      lease.cells.All() && lease.block == SampleBlock{0, 1};
    if (!fits) return absl::InvalidArgumentError("its training is not that of its frame");
  }
  const bool needs_field = NeedsTraining(settings.techniques) && lease.kind != TaskKind::kTraining;
  if (needs_field != !lease.field.sha256_hex.empty()) {
    return absl::InvalidArgumentError(needs_field ? "its guiding field is missing"
                                                  : "its task needs no guiding field");
  }
  if (needs_field) {
    if (absl::Status status = CheckDigest(lease.field); !status.ok()) return status;
    if (lease.field.size_bytes > kGuidingFieldBytesMax) {
      return absl::InvalidArgumentError(
          absl::StrCat("its guiding field has more than ", kGuidingFieldBytesMax, " bytes"));
    }
  }
  if (settings.max_depth < 0) return absl::InvalidArgumentError("its depth is negative");
  return CheckDigest(lease.scene);
}

absl::StatusOr<Lease> FromWire(const v1::Lease& message) {
  if (!v1::TaskKind_IsValid(message.key().kind())) {
    return absl::InvalidArgumentError("its kind of task is unknown");
  }
  Lease lease;
  lease.lease_id = message.lease_id();
  lease.attempt = message.attempt();
  lease.frame_name = message.frame_name();
  ReadKey(message.key(), &lease);
  lease.scene = {message.scene().sha256_hex(), message.scene().size_bytes()};
  absl::StatusOr<FrameSettings> settings = sheaf::FromWire(message.settings());
  if (!settings.ok()) return settings.status();
  lease.settings = *std::move(settings);
  lease.token = message.token();
  lease.field = {message.guiding_field().sha256_hex(), message.guiding_field().size_bytes()};
  if (absl::Status status = CheckLease(lease); !status.ok()) return status;
  return lease;
}

// Saturates: the seconds may be any number.
std::chrono::milliseconds FromWire(const google::protobuf::Duration& duration) {
  return absl::ToChronoMilliseconds(absl::Seconds(duration.seconds()) +
                                    absl::Nanoseconds(duration.nanos()));
}

}  // namespace

v1::SynchronizeRequest ToWire(const WorkerState& state) {
  v1::SynchronizeRequest request;
  request.set_worker_id(state.worker_id);
  request.set_host(state.host);
  request.set_numeric_profile(state.numeric_profile);
  request.set_thread_count(state.thread_count);
  for (const LeaseReport& report : state.leases) {
    v1::LeaseState* lease = request.add_leases();
    lease->set_lease_id(report.lease_id);
    lease->set_phase(ToWire(report.phase));
  }
  for (const LeaseFailure& failure : state.failures) {
    v1::LeaseFailure* message = request.add_failures();
    message->set_lease_id(failure.lease_id);
    message->set_kind(ToWire(failure.kind));
    message->set_message(failure.message);
    message->set_token(failure.token);
    if (failure.shortage.needed_bytes > 0) {
      message->mutable_cache_shortage()->set_needed_bytes(failure.shortage.needed_bytes);
      message->mutable_cache_shortage()->set_room_bytes(failure.shortage.room_bytes);
    }
  }
  request.set_requested_lease_count(state.requested_lease_count);
  request.set_draining(state.draining);
  for (const std::string& scene : state.warm_scenes) request.add_warm_scenes(scene);
  request.set_scene_memory_bytes(state.scene_memory_bytes);
  request.set_pool(state.pool);
  for (const std::string& tag : state.tags) request.add_tags(tag);
  request.set_memory_bytes(state.memory_bytes);
  return request;
}

v1::ResultHeader ToWire(const FinishedPart& part, const std::string& worker_id) {
  v1::ResultHeader header;
  *header.mutable_key() = KeyOf(part);
  header.set_lease_id(part.lease_id);
  header.set_worker_id(worker_id);
  header.mutable_digest()->set_sha256_hex(part.digest.sha256_hex);
  header.mutable_digest()->set_size_bytes(part.digest.size_bytes);
  header.set_ray_count(part.ray_count);
  header.set_token(part.token);
  if (!part.field.sha256_hex.empty()) {
    header.mutable_guiding_field()->set_sha256_hex(part.field.sha256_hex);
    header.mutable_guiding_field()->set_size_bytes(part.field.size_bytes);
  }
  const double seconds = std::floor(part.cpu_seconds);
  header.mutable_cpu_duration()->set_seconds(static_cast<int64_t>(seconds));
  header.mutable_cpu_duration()->set_nanos(
      static_cast<int32_t>((part.cpu_seconds - seconds) * 1e9));
  return header;
}

absl::StatusOr<DesiredState> FromWire(const v1::SynchronizeResponse& response) {
  DesiredState state;
  for (const v1::Lease& message : response.leases()) {
    absl::StatusOr<Lease> lease = FromWire(message);
    if (!lease.ok()) {
      return Annotate(lease.status(),
                      absl::StrCat("lease ", message.lease_id(), " of ", message.frame_name()));
    }
    state.leases.push_back(*std::move(lease));
  }
  state.next_synchronize = std::clamp(FromWire(response.next_synchronize_duration()),
                                      kNextSynchronizeMin, kNextSynchronizeMax);
  state.lease_duration =
      std::max(FromWire(response.lease_duration()), std::chrono::milliseconds::zero());
  state.exit = response.exit();
  state.deliveries = response.deliveries() && !response.direct_uploads();
  return state;
}

absl::StatusOr<UploadOutcome> FromWire(int outcome) {
  switch (outcome) {
    case v1::UploadResultsResponse::OUTCOME_ACCEPTED:
      return UploadOutcome::kAccepted;
    case v1::UploadResultsResponse::OUTCOME_DUPLICATE_EQUAL:
      return UploadOutcome::kDuplicateEqual;
    case v1::UploadResultsResponse::OUTCOME_DUPLICATE_MISMATCH:
      return UploadOutcome::kDuplicateMismatch;
    case v1::UploadResultsResponse::OUTCOME_SUPERSEDED:
      return UploadOutcome::kSuperseded;
    default:
      return absl::InternalError(absl::StrCat("unknown outcome ", outcome));
  }
}

}  // namespace sheaf::worker
