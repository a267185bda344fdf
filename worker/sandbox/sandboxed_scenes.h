// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SandboxedScenes: opens each scene in a process of its own, which sees that scene alone. A scene
// that breaks the renderer ends its process and fails its tasks, never the worker.
#pragma once

#include <memory>
#include <optional>
#include <stop_token>
#include <utility>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "worker/sandbox/protections.h"
#include "worker/sandbox/scene_opener.h"
#include "worker/sandbox/scene_process.h"

namespace sheaf::worker {

struct SandboxOptions {
  SandboxMode mode = SandboxMode::kNone;
  SceneProgram program;
  Protections protections = Protections::All();  // Tests leave some out.
  // Beyond these the process is killed, and its tasks fail. They end what never ends; the
  // coordinator gives up a lease after two hours.
  std::optional<absl::Duration> load_time_max;  // None: LoadTimeFor the scene.
  absl::Duration task_time_max = absl::Hours(1);
};

// The time that loading a scene may take: 2 minutes, and a second for each megabyte of its files,
// which is several times what the slowest readers need. A small scene that asks for endless work
// does not occupy a worker for an hour. Files that cannot be found add nothing.
absl::Duration LoadTimeFor(const SceneInputs& inputs);

class SandboxedScenes : public SceneOpener {
 public:
  // Finds out which protections this system permits, by starting a process with them, and logs it.
  // Requires: a mode other than kNone.
  // Errors: kFailedPrecondition if they are required and one is missing; kUnavailable and similar
  // if processes cannot be started.
  static absl::StatusOr<std::unique_ptr<SandboxedScenes>> Make(SandboxOptions options);

  OpenResult Open(const SceneInputs& inputs, std::stop_token stop) override;

  Protections protections() const { return protections_; }

 private:
  SandboxedScenes(SandboxOptions options, Protections protections)
      : options_(std::move(options)), protections_(protections) {}

  const SandboxOptions options_;
  const Protections protections_;
};

}  // namespace sheaf::worker
