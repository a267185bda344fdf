// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/sandbox/sandboxed_scenes.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <system_error>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/base/check.h"
#include "common/base/log.h"
#include "common/base/status.h"
#include "common/base/steady_time.h"
#include "worker/sandbox/scene_messages.h"
#include "worker/wire/lease_codec.h"

namespace sheaf::worker {
namespace {

using OnStop = SceneProcess::OnStop;

// Where a process with a file system of its own has its scene.
constexpr char kSceneFolder[] = "/scene";
constexpr absl::Duration kConfineTimeMax = absl::Minutes(2);

// Memory of a process besides its scene: libraries with their data, film, and buffers; and the
// stack and film of each thread.
constexpr uint64_t kProgramBytes = uint64_t{1} << 30;
constexpr uint64_t kThreadBytes = uint64_t{64} << 20;

uint64_t MemoryBytesMax(const SceneLimits& limits) {
  // Estimates of scenes are exceeded for moments, by buffers that grow.
  const double scene_bytes = 1.5 * static_cast<double>(limits.scene_memory_bytes_max);
  const uint64_t other_bytes =
      kProgramBytes + kThreadBytes * (limits.build_threads + limits.render_threads);
  const double bytes = scene_bytes + static_cast<double>(limits.texture_memory_bytes_max) +
                       static_cast<double>(limits.volume_memory_bytes_max) +
                       static_cast<double>(other_bytes);
  return bytes < 0x1p62 ? static_cast<uint64_t>(bytes) : UINT64_MAX;
}

absl::StatusOr<v1::SandboxRequest> ConfineRequestOf(const SceneInputs& inputs,
                                                    Protections protections) {
  v1::SandboxRequest request;
  request.mutable_confine()->set_protections(protections.bits());
  request.mutable_confine()->set_memory_bytes_max(MemoryBytesMax(inputs.limits));
  for (const auto& [name, path] : inputs.local_paths) {
    std::error_code error;
    const std::string source = std::filesystem::canonical(path, error).string();
    if (error) return StatusFromErrno(error.value(), absl::StrCat("finding ", path));
    v1::SandboxFile* file = request.mutable_confine()->add_files();
    file->set_name(name);
    file->set_source(source);
    // Keeps the extension of the name, by which readers select formats.
    file->set_target(
        protections.Has(Protection::kNamespaces)
            ? absl::StrCat(kSceneFolder, "/", std::filesystem::path(path).filename().string())
            : path);
  }
  return request;
}

// A failure and its class, annotated with the step that failed.
OpenResult Failed(const char* step, FailureKind kind, const absl::Status& status) {
  return {nullptr, absl::IsCancelled(status) ? status : Annotate(status, step), kind};
}

class SandboxedScene : public OpenScene {
 public:
  SandboxedScene(std::unique_ptr<SceneProcess> process, uint64_t memory_bytes,
                 absl::Duration task_time_max, uint32_t threads)
      : process_(std::move(process)),
        memory_bytes_(memory_bytes),
        task_time_max_(task_time_max),
        threads_(threads) {}

  uint64_t memory_bytes() const override { return memory_bytes_; }

  absl::Status SetField(std::string_view field, std::stop_token stop) const override {
    v1::SandboxRequest request;
    request.mutable_set_field()->set_field(std::string(field));
    const SceneProcess::Answer answer =
        process_->Call(std::move(request), task_time_max_, stop, OnStop::kCancelCall);
    if (!answer.status.ok()) return Annotate(answer.status, "setting the guiding field");
    const absl::Status status = StatusOf(answer.reply);
    return absl::IsDataLoss(status) ? status : TrustedStatus(status, stop);
  }

  absl::StatusOr<RenderedPart> Render(const Lease& lease, std::stop_token stop) const override {
    v1::SandboxRequest request;
    *request.mutable_render() = RenderRequestOf(lease);
    const SteadyTime begin = SteadyTime::Now();
    SceneProcess::Answer answer =
        process_->Call(std::move(request), task_time_max_, stop, OnStop::kCancelCall);
    if (!answer.status.ok()) return Annotate(answer.status, "rendering");
    const absl::Status status = TrustedStatus(StatusOf(answer.reply), stop);
    if (!status.ok()) return status;
    // A thread cannot take more time than has passed.
    const uint32_t threads = lease.kind == TaskKind::kTraining ? std::max(1u, threads_) : 1;
    const double most_seconds = threads * absl::ToDoubleSeconds(SteadyTime::Now() - begin);
    const double cpu_seconds = answer.reply.cpu_seconds();
    RenderedPart part{
        std::move(answer.payload), answer.reply.ray_count(),
        std::isfinite(cpu_seconds) ? std::clamp(cpu_seconds, 0.0, most_seconds) : most_seconds};
    TakePages(answer.reply, &part);
    return part;
  }

 private:
  // Keeps the meaning only of codes that a process may return.
  static absl::Status TrustedStatus(const absl::Status& status, const std::stop_token& stop) {
    const bool expected = status.ok() || absl::IsResourceExhausted(status) ||
                          (absl::IsCancelled(status) && stop.stop_requested());
    return expected ? status : absl::InternalError(status.message());
  }

  const std::unique_ptr<SceneProcess> process_;
  const uint64_t memory_bytes_;
  const absl::Duration task_time_max_;
  const uint32_t threads_;  // Threads of a training.
};

// Starts a process with the protections, and ends it. If one is not available, *missing has it.
absl::Status Probe(const SandboxOptions& options, Protections protections, Protections* missing) {
  absl::StatusOr<std::unique_ptr<SceneProcess>> process =
      SceneProcess::Start(options.program, protections);
  if (!process.ok()) return process.status();
  absl::StatusOr<v1::SandboxRequest> request = ConfineRequestOf({}, protections);
  if (!request.ok()) return request.status();
  const SceneProcess::Answer answer =
      (*process)->Call(*std::move(request), kConfineTimeMax, {}, OnStop::kKill);
  if (!answer.status.ok()) return answer.status;
  *missing = Protections(answer.reply.missing_protection());
  return StatusOf(answer.reply);
}

}  // namespace

absl::StatusOr<std::unique_ptr<SandboxedScenes>> SandboxedScenes::Make(SandboxOptions options) {
  SHEAF_CHECK(options.mode != SandboxMode::kNone);
  Protections protections = options.protections;
  std::vector<std::string> reasons;
  while (true) {
    Protections missing;
    const absl::Status status = Probe(options, protections, &missing);
    if (status.ok()) break;
    if (missing.empty()) return Annotate(status, "starting a process for scenes");
    reasons.push_back(absl::StrCat("no ", NamesOf(missing), " (", status.message(), ")"));
    if (options.mode == SandboxMode::kRequired) {
      return absl::FailedPreconditionError(
          absl::StrCat("scenes cannot be confined as --sandbox=required asks: ", reasons.back(),
                       "; permit it on this system, or use --sandbox=best"));
    }
    for (const Protection protection : kAllProtections) {
      if (missing.Has(protection)) protections.Remove(protection);
    }
  }
  LogInfo(absl::StrCat(
      "each scene renders in a process of its own; protections: ", NamesOf(protections),
      reasons.empty() ? "" : "; ", absl::StrJoin(reasons, "; ")));
  return std::unique_ptr<SandboxedScenes>(new SandboxedScenes(std::move(options), protections));
}

absl::Duration LoadTimeFor(const SceneInputs& inputs) {
  constexpr absl::Duration kLeast = absl::Minutes(2);
  constexpr double kBytesPerSecond = 1e6;
  auto bytes = static_cast<double>(inputs.on_demand_bytes);
  for (const auto& [name, path] : inputs.local_paths) {
    std::error_code unknown;
    const uintmax_t size_bytes = std::filesystem::file_size(path, unknown);
    if (!unknown) bytes += static_cast<double>(size_bytes);
  }
  return kLeast + absl::Seconds(bytes / kBytesPerSecond);
}

OpenResult SandboxedScenes::Open(const SceneInputs& inputs, std::stop_token stop) {
  constexpr char kConfining[] = "confining the scene's process";
  constexpr char kLoading[] = "loading the scene";
  if (protections_.Has(Protection::kNamespaces) && inputs.local_paths.size() > kMountedFilesMax) {
    return {
        nullptr,
        absl::ResourceExhaustedError(absl::StrCat(
            "the scene has ", inputs.local_paths.size(), " files, its process can have ",
            kMountedFilesMax, ": join meshes, or trust the scene (sheaf-worker --sandbox=none)")),
        FailureKind::kScene};
  }
  absl::StatusOr<v1::SandboxRequest> confine = ConfineRequestOf(inputs, protections_);
  if (!confine.ok()) return Failed(kConfining, FailureKind::kInfrastructure, confine.status());
  absl::StatusOr<std::unique_ptr<SceneProcess>> process =
      SceneProcess::Start(options_.program, protections_);
  if (!process.ok()) return Failed(kConfining, FailureKind::kInfrastructure, process.status());

  SceneProcess::Answer answer =
      (*process)->Call(*std::move(confine), kConfineTimeMax, stop, OnStop::kKill);
  if (!answer.status.ok()) return Failed(kConfining, answer.failure_kind, answer.status);
  if (const absl::Status status = StatusOf(answer.reply); !status.ok()) {
    return Failed(kConfining, FailureKind::kInfrastructure, status);
  }
  if (inputs.open_on_demand) (*process)->ServeFiles(inputs.open_on_demand);
  v1::SandboxRequest load;
  *load.mutable_load() = LoadRequestOf(inputs);
  const absl::Duration load_time_max = options_.load_time_max.value_or(LoadTimeFor(inputs));
  answer = (*process)->Call(std::move(load), load_time_max, stop, OnStop::kKill);
  if (absl::IsDeadlineExceeded(answer.status)) {
    answer.status = absl::DeadlineExceededError(absl::StrCat(
        answer.status.message(), ", its limit (sheaf-worker --load-seconds-max raises it)"));
  }
  if (!answer.status.ok()) return Failed(kLoading, answer.failure_kind, answer.status);
  if (const absl::Status status = StatusOf(answer.reply); !status.ok()) {
    return {nullptr, absl::IsCancelled(status) ? absl::InternalError(status.message()) : status,
            FromWire(answer.reply.failure_kind())};
  }
  return {std::make_unique<SandboxedScene>(*std::move(process), answer.reply.memory_bytes(),
                                           options_.task_time_max, inputs.limits.render_threads),
          absl::OkStatus(), FailureKind::kInternal};
}

}  // namespace sheaf::worker
