// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/sandbox/scene_messages.h"

#include <utility>

#include "common/base/printable.h"
#include "common/rpc/settings_codec.h"
#include "worker/wire/lease_codec.h"

namespace sheaf::worker {

v1::LoadSceneRequest LoadRequestOf(const SceneInputs& inputs) {
  v1::LoadSceneRequest message;
  message.set_main_file(inputs.main_file);
  *message.mutable_settings() = sheaf::ToWire(inputs.settings);
  message.set_scene_memory_bytes_max(inputs.limits.scene_memory_bytes_max);
  message.set_texture_memory_bytes_max(inputs.limits.texture_memory_bytes_max);
  message.set_volume_memory_bytes_max(inputs.limits.volume_memory_bytes_max);
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
                   message.build_threads(), message.render_threads(),
                   message.volume_memory_bytes_max()};
  return inputs;
}

v1::RenderTaskRequest RenderRequestOf(const Lease& lease) {
  v1::RenderTaskRequest message;
  message.set_frame_name(lease.frame_name);
  *message.mutable_key() = KeyOf(lease);
  *message.mutable_settings() = sheaf::ToWire(lease.settings);
  return message;
}

absl::StatusOr<Lease> FromWire(const v1::RenderTaskRequest& message) {
  absl::StatusOr<FrameSettings> settings = sheaf::FromWire(message.settings());
  if (!settings.ok()) return settings.status();
  Lease lease;
  lease.frame_name = message.frame_name();
  ReadKey(message.key(), &lease);
  lease.settings = *std::move(settings);
  return lease;
}

void SetStatus(const absl::Status& status, v1::SandboxReply* reply) {
  reply->set_code(static_cast<int32_t>(status.code()));
  reply->set_message(Printable(std::string(status.message()), kReplyTextBytesMax));
}

namespace {

absl::Status MakeStatus(int32_t code, const std::string& message) {
  const bool known = code >= 0 && code <= static_cast<int32_t>(absl::StatusCode::kUnauthenticated);
  return absl::Status(known ? static_cast<absl::StatusCode>(code) : absl::StatusCode::kUnknown,
                      Printable(message, kReplyTextBytesMax));
}

}  // namespace

absl::Status StatusOf(const v1::SandboxReply& reply) {
  return MakeStatus(reply.code(), reply.message());
}

absl::Status StatusOf(const v1::FileOpened& opened) {
  return MakeStatus(opened.code(), opened.message());
}

void SetPages(const RenderedPart& part, v1::SandboxReply* reply) {
  if (part.pages.pages_pinned == 0) return;
  v1::VolumePageCounts& pages = *reply->mutable_pages();
  pages.set_pinned(part.pages.pages_pinned);
  pages.set_read(part.pages.pages_read);
  pages.set_read_bytes(part.pages.bytes_read);
  pages.set_evicted(part.pages.pages_evicted);
  pages.set_resident_bytes(part.page_bytes);
}

void TakePages(const v1::SandboxReply& reply, RenderedPart* part) {
  const v1::VolumePageCounts& pages = reply.pages();
  part->pages = {pages.read(), pages.read_bytes(), 0, pages.evicted(), pages.pinned()};
  part->page_bytes = pages.resident_bytes();
}

}  // namespace sheaf::worker
