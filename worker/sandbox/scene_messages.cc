// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/sandbox/scene_messages.h"

#include <utility>

#include "common/base/printable.h"
#include "common/rpc/settings_codec.h"

namespace sheaf::worker {

v1::LoadSceneRequest LoadRequestOf(const SceneInputs& inputs) {
  v1::LoadSceneRequest message;
  message.set_main_file(inputs.main_file);
  *message.mutable_settings() = sheaf::ToWire(inputs.settings);
  message.set_scene_memory_bytes_max(inputs.limits.scene_memory_bytes_max);
  message.set_texture_memory_bytes_max(inputs.limits.texture_memory_bytes_max);
  message.set_build_threads(inputs.limits.build_threads);
  message.set_render_threads(inputs.limits.render_threads);
  return message;
}

absl::StatusOr<SceneInputs> FromWire(const v1::LoadSceneRequest& message) {
  absl::StatusOr<FrameSettings> settings = sheaf::FromWire(message.settings());
  if (!settings.ok()) return settings.status();
  SceneInputs inputs;
  inputs.main_file = message.main_file();
  inputs.settings = *std::move(settings);
  inputs.limits = {message.scene_memory_bytes_max(), message.texture_memory_bytes_max(),
                   message.build_threads(), message.render_threads()};
  return inputs;
}

v1::RenderTaskRequest RenderRequestOf(const Lease& lease) {
  v1::RenderTaskRequest message;
  message.set_frame_name(lease.frame_name);
  v1::ResultKey& key = *message.mutable_key();
  key.set_frame_digest(lease.frame_digest);
  *key.mutable_tile() = sheaf::ToWire(lease.tile);
  key.mutable_block()->set_first(lease.block.first);
  key.mutable_block()->set_count(lease.block.count);
  key.set_cell_size_px(lease.cells.size_px);
  key.set_cells(lease.cells.mask);
  *message.mutable_settings() = sheaf::ToWire(lease.settings);
  return message;
}

absl::StatusOr<Lease> FromWire(const v1::RenderTaskRequest& message) {
  absl::StatusOr<FrameSettings> settings = sheaf::FromWire(message.settings());
  if (!settings.ok()) return settings.status();
  const v1::ResultKey& key = message.key();
  Lease lease;
  lease.frame_name = message.frame_name();
  lease.frame_digest = key.frame_digest();
  lease.tile = sheaf::FromWire(key.tile());
  lease.block = {key.block().first(), key.block().count()};
  lease.cells = {key.cell_size_px(), key.cells()};
  lease.settings = *std::move(settings);
  return lease;
}

void SetStatus(const absl::Status& status, v1::SandboxReply* reply) {
  reply->set_code(static_cast<int32_t>(status.code()));
  reply->set_message(Printable(std::string(status.message()), kReplyTextBytesMax));
}

absl::Status StatusOf(const v1::SandboxReply& reply) {
  const bool known =
      reply.code() >= 0 && reply.code() <= static_cast<int32_t>(absl::StatusCode::kUnauthenticated);
  return absl::Status(
      known ? static_cast<absl::StatusCode>(reply.code()) : absl::StatusCode::kUnknown,
      Printable(reply.message(), kReplyTextBytesMax));
}

v1::LeaseFailure::Kind KindToWire(FailureKind kind) {
  switch (kind) {
    case FailureKind::kReleased:
      return v1::LeaseFailure::KIND_RELEASED;
    case FailureKind::kInfrastructure:
      return v1::LeaseFailure::KIND_INFRASTRUCTURE;
    case FailureKind::kScene:
      return v1::LeaseFailure::KIND_SCENE;
    case FailureKind::kMemory:
      return v1::LeaseFailure::KIND_MEMORY;
    case FailureKind::kInternal:
      return v1::LeaseFailure::KIND_INTERNAL;
  }
  return v1::LeaseFailure::KIND_INTERNAL;
}

FailureKind KindFromWire(v1::LeaseFailure::Kind kind) {
  switch (kind) {
    case v1::LeaseFailure::KIND_INFRASTRUCTURE:
      return FailureKind::kInfrastructure;
    case v1::LeaseFailure::KIND_SCENE:
      return FailureKind::kScene;
    case v1::LeaseFailure::KIND_MEMORY:
      return FailureKind::kMemory;
    default:
      return FailureKind::kInternal;
  }
}

}  // namespace sheaf::worker
