// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A FarmView whose contents a test sets, to test the HTTP port without a farm. Tests only.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/mutex.h"
#include "common/film/shrink_image.h"
#include "coordinator/service/view/farm_view.h"
#include "coordinator/service/view/pixel_view.h"

namespace sheaf::coordinator {

// Thread safety: as for FarmView.
class FakeFarm : public FarmView {
 public:
  std::vector<JobView> jobs;  // With their frames.
  std::vector<WorkerView> workers;
  std::vector<MetricView> metrics;
  std::vector<FailureView> failures;  // Returned for every job.
  std::vector<JobEvent> events;       // The same.
  RefinementPrices prices;            // Returned for every job, with the targets of the call.
  absl::Status ready;
  PreviewView preview;        // The same for every frame.
  PreviewView round_preview;  // The same for every round that has a version.

  // Applies a change under the lock and wakes all waiting calls.
  template <class Change>
  void Update(Change change) {
    {
      const MutexLock lock(&mutex_);
      change(*this);
      ++change_count_;
    }
    changed_.NotifyAll();
  }

  std::vector<JobView> ListJobs() const override {
    const MutexLock lock(&mutex_);
    std::vector<JobView> list = jobs;
    for (JobView& job : list) job.frames.clear();
    return list;
  }
  absl::StatusOr<JobView> FindJobChanges(const std::string& job_id,
                                         FrameMarks* /*marks*/) const override {
    return FindJob(job_id);
  }
  absl::StatusOr<JobView> FindJob(const std::string& job_id) const override {
    const MutexLock lock(&mutex_);
    for (const JobView& job : jobs) {
      if (job.job_id == job_id) return job;
    }
    return absl::NotFoundError(absl::StrCat("no job jobs/", job_id));
  }
  absl::StatusOr<std::vector<FailureView>> ListFailures(const std::string& job_id) const override {
    if (absl::Status found = FindJob(job_id).status(); !found.ok()) return found;
    const MutexLock lock(&mutex_);
    return failures;
  }
  absl::StatusOr<std::vector<JobEvent>> ListEvents(const std::string& job_id) const override {
    if (absl::Status found = FindJob(job_id).status(); !found.ok()) return found;
    const MutexLock lock(&mutex_);
    return events;
  }
  absl::StatusOr<RefinementPrices> PriceRefinement(
      const std::string& job_id, const std::vector<double>& target_errors) const override {
    if (absl::Status found = FindJob(job_id).status(); !found.ok()) return found;
    const MutexLock lock(&mutex_);
    RefinementPrices priced = prices;
    for (const double target : target_errors) {
      RefinementPrice& price = priced.prices.emplace_back();
      price.target_error = target;
      // A relMSE of 0.001 costs one second of CPU time, 0.002 half a second.
      const double seconds = 1e-3 / target;
      price.reached = true;
      price.relative_mse = {target, 0.9 * target, target};
      price.samples_per_pixel = {16 * seconds, 12 * seconds, 24 * seconds};
      price.cpu_seconds = {seconds, 0.8 * seconds, 1.25 * seconds};
      if (prices.thread_count > 0)
        price.wall_seconds = {seconds / 2, 0.4 * seconds, 0.625 * seconds};
    }
    return priced;
  }
  std::vector<WorkerView> ListWorkers() const override {
    const MutexLock lock(&mutex_);
    return workers;
  }
  std::vector<MetricView> Metrics() const override {
    const MutexLock lock(&mutex_);
    return metrics;
  }
  absl::StatusOr<PreviewView> Preview(const std::string&, int32_t,
                                      const std::vector<std::string>&) const override {
    const MutexLock lock(&mutex_);
    if (preview.version == 0) return absl::UnavailableError("has no samples yet");
    return preview;
  }
  absl::StatusOr<PreviewView> Thumbnail(const std::string& job_id,
                                        int32_t frame_number) const override {
    absl::StatusOr<PreviewView> view = Preview(job_id, frame_number, {});
    if (!view.ok()) return view.status();
    absl::StatusOr<FrameImage> small =
        ShrinkImage(view->image, {"R", "G", "B"}, kThumbnailPixelCountMax);
    if (!small.ok()) return small.status();
    view->image = *std::move(small);
    return view;
  }
  absl::StatusOr<PreviewView> RoundPreview(const std::string& job_id, int32_t frame_number,
                                           int32_t round) const override {
    const MutexLock lock(&mutex_);
    for (const JobView& job : jobs) {
      if (job.job_id != job_id) continue;
      for (const FrameView& frame : job.frames) {
        const auto index = static_cast<size_t>(round);
        if (frame.frame_number != frame_number || round < 0 || index >= frame.rounds.size()) {
          continue;
        }
        PreviewView view = round_preview;
        view.version = frame.rounds[index].preview_version;
        if (view.version > 0) return view;
      }
    }
    return absl::NotFoundError("no such round is kept");
  }
  std::vector<ReadyCondition> Conditions() const override {
    const MutexLock lock(&mutex_);
    return {{"database", ready}, {"disk", absl::OkStatus()}};
  }
  uint64_t ChangeCount() const override {
    const MutexLock lock(&mutex_);
    return change_count_;
  }
  uint64_t WaitForChange(uint64_t seen, absl::Duration timeout) const override {
    const MutexLock lock(&mutex_);
    const auto changed = [&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
      return change_count_ != seen;
    };
    changed_.WaitFor(&mutex_, timeout, changed);
    return change_count_;
  }

 private:
  mutable Mutex mutex_;
  mutable CondVar changed_;
  uint64_t change_count_ ABSL_GUARDED_BY(mutex_) = 1;
};

// The pixel of an image that FakeFarm shows, as Farm::ReadPixel returns it.
inline absl::StatusOr<PixelView> FakePixel(const PreviewView& preview, int32_t x_px, int32_t y_px) {
  const PixelRect& window = preview.image.window;
  if (x_px < window.x0 || x_px >= window.x1 || y_px < window.y0 || y_px >= window.y1) {
    return absl::OutOfRangeError(absl::StrCat("no pixel ", x_px, ", ", y_px));
  }
  PixelView pixel{preview.version, {}};
  const auto index = static_cast<size_t>(window.IndexOf(x_px, y_px));
  for (size_t i = 0; i < preview.image.planes.size(); ++i) {
    pixel.channels.emplace_back(preview.image.channel_names[i], preview.image.planes[i][index]);
  }
  return pixel;
}

// A running job of one frame, 4 x 2 pixels at 16 samples, with a quarter of its samples.
inline JobView MakeFakeJob(const std::string& job_id) {
  FrameView frame;
  frame.frame_number = 1;
  frame.settings.width_px = 4;
  frame.settings.height_px = 2;
  frame.settings.window = {0, 0, 4, 2};
  frame.settings.samples = 16;
  frame.settings.similarity_after = 8;
  frame.settings.techniques = TechniqueSet::kCameraAndLight;
  frame.preview_version = 3;
  frame.progress.sample_count_done = 32;
  frame.progress.sample_count_total = 128;
  JobView job;
  job.job_id = job_id;
  job.title = "job " + job_id;
  job.state = JobState::kRunning;
  job.create_time = absl::FromUnixMillis(1700000000123);
  job.frame_count = 1;
  job.progress = frame.progress;
  job.frames = {frame};
  NotePreviewFrame(frame, &job);
  return job;
}

// An image of one color, with 16 samples in every pixel, a standard error of a tenth of the value,
// and one millisecond of CPU time per pixel.
inline FrameImage MakeFakeImage(int32_t width_px, int32_t height_px, float level) {
  FrameImage image;
  image.window = {0, 0, width_px, height_px};
  image.frame_width_px = width_px;
  image.frame_height_px = height_px;
  image.channel_names = {"R", "G", "B", "stderr.R", "stderr.G", "stderr.B", "samples", kCpuChannel};
  const size_t count = static_cast<size_t>(width_px) * static_cast<size_t>(height_px);
  image.planes.assign(3, std::vector<float>(count, level));
  image.planes.resize(6, std::vector<float>(count, 0.1f * level));
  image.planes.emplace_back(count, 16.0f);
  image.planes.emplace_back(count, 0.001f);
  return image;
}

}  // namespace sheaf::coordinator
