// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/view/view_server.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <utility>

namespace sheaf::cli {
namespace {

// The first image has as many pixels as are expected to take this long.
constexpr double kFirstImageSeconds = 0.05;
constexpr int32_t kDivisorMax = 8;
// A window with fewer pixels in its shorter direction is not rendered.
constexpr int32_t kCoarsePxMin = 32;
// Later blocks have this many samples, so that an end of a view is never far.
constexpr uint64_t kBlockSamplesMax = 16;
// An image is given where the samples have doubled, or after this time.
constexpr double kImageSeconds = 1;

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// The aligned block that follows `done` samples.
SampleBlock NextBlock(uint64_t done, uint64_t samples) {
  uint64_t count = done == 0 ? 1 : std::min(std::bit_floor(done), kBlockSamplesMax);
  while (done % count != 0 || done + count > samples) count /= 2;
  return {done, count};
}

}  // namespace

ViewServer::ViewServer(const RenderSettings& settings, int threads, ViewEvents events)
    : settings_(settings), threads_(threads), events_(std::move(events)) {
  thread_ = std::jthread([this] { Run(); });
}

ViewServer::~ViewServer() {
  const MutexLock lock(&mutex_);
  ends_ = true;
  stop_.request_stop();
  changed_.NotifyAll();
}

void ViewServer::Ask(ViewRequest request) {
  const MutexLock lock(&mutex_);
  if (wanted_) {
    if (request.scene.empty()) request.scene = std::move(wanted_->scene);
    if (request.camera.empty()) request.camera = std::move(wanted_->camera);
  }
  wanted_ = std::move(request);
  stop_.request_stop();
  changed_.NotifyAll();
}

void ViewServer::Wait() {
  const MutexLock lock(&mutex_);
  const auto is_idle = [this]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    return ends_ || (!is_busy_ && !wanted_);
  };
  changed_.Wait(&mutex_, is_idle);
}

std::optional<ViewRequest> ViewServer::NextRequest(std::stop_token* stop) {
  const MutexLock lock(&mutex_);
  const auto is_due = [this]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    return ends_ || wanted_.has_value();
  };
  changed_.Wait(&mutex_, is_due);
  if (ends_) return std::nullopt;
  stop_ = std::stop_source();
  *stop = stop_.get_token();
  is_busy_ = true;
  return std::exchange(wanted_, std::nullopt);
}

void ViewServer::Run() {
  std::stop_token stop;
  while (const std::optional<ViewRequest> request = NextRequest(&stop)) {
    const bool is_taken = Handle(*request, stop);
    const MutexLock lock(&mutex_);
    is_busy_ = false;
    ends_ = ends_ || !is_taken;
    changed_.NotifyAll();
  }
}

bool ViewServer::Handle(const ViewRequest& request, const std::stop_token& stop) {
  absl::Status status;
  if (!request.camera.empty()) {
    absl::StatusOr<SampledView> view = ReadView(request.camera, settings_);
    status = view.status();
    if (view.ok()) view_ = *std::move(view);
  }
  if (status.ok() && !request.scene.empty()) {
    const auto start = Clock::now();
    status = Load(request);
    if (status.ok() && !events_.on_loaded(request.id, *scene_, SecondsSince(start))) return false;
  }
  if (status.ok() && scene_ == nullptr) {
    status = absl::FailedPreconditionError("no scene is loaded; name one in the request");
  }
  if (status.ok()) status = Refine(request.id, stop);
  if (status.ok() || absl::IsCancelled(status)) return true;
  if (absl::IsAborted(status)) return false;
  return events_.on_error(request.id, status);
}

absl::Status ViewServer::Load(const ViewRequest& request) {
  scene_ = nullptr;  // Its memory first.
  path_ = request.scene;
  absl::StatusOr<std::unique_ptr<ViewedScene>> loaded =
      ViewedScene::Load(path_, settings_, view_ ? &*view_ : nullptr);
  if (!loaded.ok()) return loaded.status();
  scene_ = *std::move(loaded);
  view_ = scene_->first_view();
  seconds_per_sample_ = 0;
  return absl::OkStatus();
}

absl::Status ViewServer::Show(const render::SceneView& view) {
  const absl::Status shown = scene_->Show(view);
  if (!absl::IsFailedPrecondition(shown)) return shown;
  const std::unique_ptr<ViewedScene> old = std::move(scene_);
  absl::StatusOr<std::unique_ptr<ViewedScene>> loaded =
      ViewedScene::Load(path_, settings_, &*view_);
  if (!loaded.ok()) return loaded.status();
  scene_ = *std::move(loaded);
  return scene_->Show(view);
}

int32_t ViewServer::FirstDivisor() const {
  const PixelRect& window = view_->view.window;
  const auto pixels = static_cast<double>(window.PixelCount());
  int32_t divisor = 1;
  while (divisor < kDivisorMax &&
         std::min(window.Width(), window.Height()) / (2 * divisor) >= kCoarsePxMin &&
         (seconds_per_sample_ == 0 ||
          pixels * seconds_per_sample_ > kFirstImageSeconds * divisor * divisor)) {
    divisor *= 2;
  }
  return divisor;
}

absl::Status ViewServer::Refine(int64_t id, const std::stop_token& stop) {
  for (int32_t divisor = FirstDivisor(); divisor >= 1; divisor /= 2) {
    const render::SceneView view = Coarse(view_->view, divisor);
    if (absl::Status status = Show(view); !status.ok()) return status;
    ViewImage image(view.window);
    const uint64_t samples = divisor > 1 ? 1 : view_->samples;
    auto given = Clock::now();
    uint64_t done = 0, given_samples = 0;
    while (done < samples) {
      const SampleBlock block = NextBlock(done, samples);
      const auto start = Clock::now();
      absl::Status status = scene_->Render(block, threads_, stop, &image);
      if (!status.ok()) return status;
      done = block.End();
      seconds_per_sample_ = SecondsSince(start) / static_cast<double>(block.count) /
                            static_cast<double>(view.window.PixelCount());
      if (done < samples && done < 2 * given_samples && SecondsSince(given) < kImageSeconds) {
        continue;
      }
      status = GiveFrame(id, divisor, done, image);
      if (!status.ok()) return status;
      given = Clock::now();
      given_samples = done;
    }
  }
  return absl::OkStatus();
}

absl::Status ViewServer::GiveFrame(int64_t id, int32_t divisor, uint64_t samples,
                                   const ViewImage& image) {
  const ViewFrame frame{id,
                        view_->view.width_px,
                        view_->view.height_px,
                        divisor,
                        image.window(),
                        samples,
                        divisor == 1 && samples == view_->samples,
                        image.Pixels()};
  return events_.on_frame(frame) ? absl::OkStatus()
                                 : absl::AbortedError("the answer was not taken");
}

}  // namespace sheaf::cli
