// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/first_image.h"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <memory>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>

#include "absl/status/status.h"
#include "cli/commands/local_farm.h"
#include "cli/job/follow_job.h"
#include "cli/message.h"
#include "common/base/log.h"
#include "common/base/mutex.h"
#include "common/base/surroundings/process_memory.h"
#include "common/film/frame_image.h"
#include "common/film/task_kind.h"
#include "common/scene/settings/techniques.h"

namespace sheaf::cli {
namespace {

// An account is taken where the process has grown by this factor since the last one: it takes
// milliseconds, and there are many tasks.
constexpr double kGrowthNoted = 1.01;

// The image into which the coordinator merges, and the error of its colors; frames with light paths
// have one for each kind of path, and their sum.
uint64_t ImageBytesOf(const FrameSettings& settings) {
  const auto pixels = static_cast<uint64_t>(settings.window.PixelCount());
  const size_t error_planes = settings.one_sequence ? 0 : 3;
  const size_t of_camera = ImageChannelCount(settings.outputs);
  size_t planes = of_camera + error_planes;
  if (HasLightPaths(settings.techniques)) {
    planes += of_camera + ImageChannelCount(LightOutputsOf(settings)) + error_planes;
  }
  return pixels * planes * sizeof(float);
}

// Keeps the account of the moment at which the process was largest.
class LargestMemory {
 public:
  explicit LargestMemory(uint64_t program_bytes) { beside_.program_bytes = program_bytes; }

  // Before the first Note, whose callers it outlives. image_bytes: those of the frame's image.
  void SetFarm(const LocalFarm* farm, uint64_t farm_bytes, uint64_t image_bytes) {
    const MutexLock lock(&mutex_);
    farm_ = farm;
    beside_.farm_bytes = farm_bytes;
    beside_.film_bytes = image_bytes;
  }
  void Note(const render::SceneMemory& scene) {
    const MutexLock lock(&mutex_);
    scene_ = scene;
    NoteLargest();
  }
  // Notes it until stopped: light passes, and the coordinator's work on their results, hold the
  // most between tasks' ends.
  void Watch(std::stop_token stop) {
    constexpr std::chrono::milliseconds kBetween{2};
    while (!stop.stop_requested()) {
      {
        const MutexLock lock(&mutex_);
        NoteLargest();
      }
      std::this_thread::sleep_for(kBetween);
    }
  }
  MemoryAccount Largest() const {
    const MutexLock lock(&mutex_);
    return largest_;
  }

 private:
  void NoteLargest() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    const auto noted_bytes = static_cast<double>(largest_.resident_bytes);
    if (static_cast<double>(ResidentBytesNow()) <= kGrowthNoted * noted_bytes) return;
    MemoryBesideScene beside = beside_;
    beside.film_bytes += farm_->film_bytes();
    MemoryAccount now = MakeMemoryAccount(scene_, beside, ProcessMemoryNow());
    if (now.resident_bytes > largest_.resident_bytes) largest_ = std::move(now);
  }

  mutable Mutex mutex_;
  render::SceneMemory scene_ ABSL_GUARDED_BY(mutex_);  // As last told.
  const LocalFarm* farm_ ABSL_GUARDED_BY(mutex_) = nullptr;
  MemoryBesideScene beside_ ABSL_GUARDED_BY(mutex_);
  MemoryAccount largest_ ABSL_GUARDED_BY(mutex_);
};

uint64_t HeapBytes() { return ProcessMemoryNow().heap_used_bytes; }

}  // namespace

ExitCode RenderFirstImage(JobArguments arguments, bool measures_memory,
                          const Interruption& interruption, FirstImage* image) {
  SetLogName("sheaf plan");
  SetLogLevel(LogLevel::kWarning);
  arguments.settings.samples = 1;
  LargestMemory memory(HeapBytes());
  absl::StatusOr<PreparedJob> job = PrepareJob(arguments, /*keeps_description=*/true);
  if (!job.ok()) return ReportSceneError(job.status());
  for (const std::string& text : job->diagnostics) PrintSceneNote(text);

  LocalFarmOptions options;
  worker::DirectScenes::MemoryWatch watch;
  if (measures_memory) watch = [&memory](const render::SceneMemory& scene) { memory.Note(scene); };
  options.worker.scenes = ScenesOf(&*job, std::move(watch));
  const uint64_t before_bytes = HeapBytes();
  const absl::StatusOr<std::unique_ptr<LocalFarm>> farm = LocalFarm::Open(options);
  if (!farm.ok()) return ReportError(ExitCode::kFile, farm.status());
  const uint64_t after_bytes = HeapBytes();
  memory.SetFarm(farm->get(), after_bytes - std::min(after_bytes, before_bytes),
                 ImageBytesOf(job->frames.front().settings));
  FarmClient client((*farm)->channel(), "this process", interruption.token());
  if (absl::Status status = UploadMissing(&client, *job, (*farm)->blobs()); !status.ok()) {
    return ReportCallError(status);
  }
  const absl::StatusOr<v1::Job> created = client.CreateJob(MakeCreateJobRequest(arguments, *job));
  if (!created.ok()) return ReportCallError(created.status());
  if (absl::Status status = (*farm)->StartWorker(); !status.ok()) {
    return ReportError(ExitCode::kFile, status);
  }
  std::jthread watching;
  if (measures_memory) {
    watching = std::jthread([&memory](std::stop_token stop) { memory.Watch(std::move(stop)); });
  }
  const absl::StatusOr<v1::Job> ended = client.WatchJob(created->name(), [](const v1::Job&) {});
  watching = {};  // Stops it.
  if (!ended.ok()) return ReportCallError(ended.status());
  *image = {LoadTimesNow(), memory.Largest()};
  return ReportEnd(*ended, /*images_written=*/true, /*remedy=*/"", arguments.detail);
}

}  // namespace sheaf::cli
