// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Conversion between plain values and the messages of proto/sheaf/v1/sandbox.proto, and their
// limits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/process/child_process.h"
#include "sheaf/v1/sandbox.pb.h"
#include "worker/agent/work.h"
#include "worker/sandbox/confinement.h"
#include "worker/sandbox/message_channel.h"
#include "worker/sandbox/scene_opener.h"

namespace sheaf::worker {

// The descriptor by which a scene's process talks with its worker.
inline constexpr int kSceneSocket = kChildSocket;

// Messages that a process accepts from its worker: the names of all files of a scene come in one
// message.
inline constexpr MessageLimits kRequestLimits{uint32_t{1} << 30, 0, true};
// Messages that a worker accepts from a process. The coordinator refuses larger parts, too.
inline constexpr MessageLimits kReplyLimits{uint32_t{64} << 10, uint32_t{512} << 20};
// The text of a message for users. Longer ones are cut, by both ends.
inline constexpr size_t kReplyTextBytesMax = 4'096;

v1::LoadSceneRequest LoadRequestOf(const SceneInputs& inputs);
// Without local_paths. Errors: kInvalidArgument.
absl::StatusOr<SceneInputs> FromWire(const v1::LoadSceneRequest& message);

v1::RenderTaskRequest RenderRequestOf(const Lease& lease);
// A lease with all that rendering needs. Errors: kInvalidArgument.
absl::StatusOr<Lease> FromWire(const v1::RenderTaskRequest& message);

// Puts a failure into a reply.
void SetStatus(const absl::Status& status, v1::SandboxReply* reply);
// The status of a reply, whose numbers and text are untrusted.
absl::Status StatusOf(const v1::SandboxReply& reply);
absl::Status StatusOf(const v1::FileOpened& opened);
// The figures of pages that come with a part.
void SetPages(const RenderedPart& part, v1::SandboxReply* reply);
void TakePages(const v1::SandboxReply& reply, RenderedPart* part);

}  // namespace sheaf::worker
