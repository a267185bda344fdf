// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ViewServer: takes requests, the newest first, and gives coarse images, then finer ones.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "cli/view/view_request.h"
#include "cli/view/viewed_scene.h"
#include "common/base/mutex.h"

namespace sheaf::cli {

// An image that a request gets.
struct ViewFrame {
  int64_t id = 0;  // The request's.
  int32_t film_width_px = 0, film_height_px = 0;
  int32_t divisor = 1;        // Each pixel stands for this many in each direction of the film.
  PixelRect window;           // In pixels of this image: times the divisor, a part of the film.
  uint64_t samples = 0;       // Per pixel.
  bool is_complete = false;   // Whether it is the request's last one.
  std::vector<float> pixels;  // As of ViewImage::Pixels.
};

// Called on the thread of the server, one at a time. A function that returns false ends it.
struct ViewEvents {
  std::function<bool(const ViewFrame&)> on_frame;
  std::function<bool(int64_t id, const ViewedScene&, double seconds)> on_loaded;
  std::function<bool(int64_t id, const absl::Status&)> on_error;
};

// Thread safety: members may be called concurrently.
class ViewServer {
 public:
  ViewServer(const RenderSettings& settings, int threads, ViewEvents events);
  // Ends what is rendered; waits for a scene that is being loaded.
  ~ViewServer();
  ViewServer(const ViewServer&) = delete;
  ViewServer& operator=(const ViewServer&) = delete;

  // Replaces requests that have no image yet, and ends the images of older ones. The scene of a
  // request that is replaced before it was loaded, and its camera, hold for the new one where that
  // has none.
  void Ask(ViewRequest request);
  // Waits until the last request has all its images, or an event ended the server.
  void Wait();

 private:
  using Clock = std::chrono::steady_clock;
  void Run();
  // Waits for a request, and marks the server as busy with it; none if the server ends.
  std::optional<ViewRequest> NextRequest(std::stop_token* stop);
  // False if an event ended the server.
  bool Handle(const ViewRequest& request, const std::stop_token& stop);
  absl::Status Load(const ViewRequest& request);
  absl::Status Show(const render::SceneView& view);
  // Renders and gives the images of the view. Errors: kCancelled; those of rendering.
  absl::Status Refine(int64_t id, const std::stop_token& stop);
  absl::Status GiveFrame(int64_t id, int32_t divisor, uint64_t samples, const ViewImage& image);
  int32_t FirstDivisor() const;

  const RenderSettings settings_;
  const int threads_;
  const ViewEvents events_;

  // Used by the server's thread alone.
  std::unique_ptr<ViewedScene> scene_;
  std::string path_;  // The scene's.
  std::optional<SampledView> view_;
  double seconds_per_sample_ = 0;  // For a pixel; 0: unknown.

  Mutex mutex_;
  CondVar changed_;
  std::optional<ViewRequest> wanted_ ABSL_GUARDED_BY(mutex_);
  std::stop_source stop_ ABSL_GUARDED_BY(mutex_);  // Ends the request that is worked on.
  bool is_busy_ ABSL_GUARDED_BY(mutex_) = false, ends_ ABSL_GUARDED_BY(mutex_) = false;
  std::jthread thread_;
};

}  // namespace sheaf::cli
