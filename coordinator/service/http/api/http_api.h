// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The responses of the HTTP port: health, metrics, and the farm's state as JSON and images.
//
//   GET  /healthz                                   200 while the process serves: {"healthy": true}
//   GET  /readyz                                    200 if work is accepted, else 503; with the
//        conditions: {"ready": false, "conditions": [{"name": "disk", "ok": false, "reason":
//        "..."},
//        ...]}
//   GET  /metrics                                   Prometheus text
//   GET  /api/v1/jobs?page_size&page_token          jobs, newest first, without frames
//   GET  /api/v1/jobs/ID?page_size&page_token       one job with a page of its frames
//   GET  /api/v1/jobs/ID/failures                   the last failed leases, newest first, each with
//        the command that renders its tile again on one machine
//   POST /api/v1/jobs/ID:delete                     removes a job that has ended, with its images:
//        {"name": "jobs/7"}
//   POST /api/v1/jobs/ID:cancel                     cancels the job; idempotent
//   POST /api/v1/jobs/ID:pause, ID:resume           stops or resumes granting leases; idempotent
//   POST /api/v1/jobs/ID:pin, ID:unpin              keeps all its data, or not; idempotent
//   POST /api/v1/gc?dry_run=1                       removes items that are no longer kept, and
//        lists them; with dry_run=1 only lists them
//   POST /api/v1/jobs/ID:priority?value=N           sets the priority, from -1000 to 1000; jobs of
//        higher priority go first; idempotent
//   POST /api/v1/jobs/ID:retry?frame=N&task=T       tries failed work again: of the job, or of one
//        frame or task (the number of a tile)
//   POST /api/v1/jobs/ID:kill?frame=N&task=T        gives up a frame, or one task of it
//   POST /api/v1/jobs/ID:release                    starts a job that waits for others; idempotent
//   POST /api/v1/jobs/ID:approve?frames=N,N,...     renders frames to the end that wait for
//        approval: these, or all that wait now; idempotent
//   POST /api/v1/jobs/ID:refine?target_error=E&samples=N
//        refines a job that succeeded until its frames' relMSE is at most E, with at most N
//        samples per pixel; without E, with N samples; idempotent
//   GET  /api/v1/jobs/ID/refine-price?target_error=E,E,...
//        the cost of such a refinement, beyond existing samples, for up to 32 values of E
//   GET  /api/v1/jobs/ID/frames/N                   one frame
//   GET  /api/v1/jobs/ID/frames/N/preview.png?layer=NAME
//        the image so far; 204 if there is none. Layers: image, light, error, samples and time
//        (image_layer.h); the last three have a header X-Sheaf-Range: LOW HIGH, the values at the
//        ends of their false colors
//   GET  /api/v1/jobs/ID/frames/N/preview.png?size=thumbnail
//        a small copy of the image so far; 204 if there is none
//   GET  /api/v1/jobs/ID/frames/N/preview.png?layer=NAME&round=R
//        a small copy of a layer at the end of a round (from 0); 404 if it is not kept: the frame's
//        rounds[R].preview_version is then 0
//   GET  /api/v1/jobs/ID/frames/N/preview.png?layer=image&of=NAME
//        a layer of .../layers instead of the color; layer=light for those of kind color
//   GET  /api/v1/jobs/ID/frames/N/preview.png?with=jobs/8/frames/1&difference=absolute
//        the difference from another frame's image, or its ratio (relative), in false color with
//        X-Sheaf-Range; of=NAME and with_of=NAME: of layers of kind color of the two frames
//   GET  /api/v1/jobs/ID/frames/N/preview.png?layer=NAME&range=LOW,HIGH
//        the values at the ends of the false colors, of any image that has them
//   GET  /api/v1/jobs/ID/frames/N/preview.png?size=full
//        the delivered image in its own size
//   GET  /api/v1/jobs/ID/frames/N/layers            the layers beside the color: {"layers":
//        [{"name": "albedo", "kind": "color", "channels": ["albedo.R", ...]}, ...]}
//   GET  /api/v1/jobs/ID/frames/N/pixel?x=X&y=Y     all channels of a pixel, linear: {"version": 3,
//        "x": 10, "y": 20, "channels": [{"name": "R", "value": 0.18}, ...]}; other values are
//        "nan", "inf" and "-inf"
//   GET  /api/v1/false-color.png                    the false colors from low to high, one row
//   GET  /api/v1/jobs/ID/frames/N/output.exr        the delivered image
//   GET  /api/v1/workers?page_size&page_token       workers; all of them without page_size
//   POST /api/v1/workers/ID:drain, ID:undrain       gives the worker no further leases, or some
//        again; idempotent
//   GET  /api/v1/farm                               how workers and sheaf reach the coordinator:
//        {"grpc_port": 7400, "tls": false}; 0 for no port
//   GET  /api/v1/session                            who is signed in: {"user": "anna", "role":
//        "submit"}; both are "" for a coordinator without certificates
//   GET  /api/v1/counters                           the numbers of /metrics as JSON, without
//        histograms
//   GET  /api/v1/usage?by=user&since=2026-05-01&until=2026-05-31&daily=1&format=csv
//        the usage of jobs, by user, show or job, and users' stored bytes; for all users with the
//        role operate, else for the caller. All parameters are optional; the CSV has only the sums
//   GET  /api/v1/events                             changes, as server-sent events. Events of type
//        job, frame and worker carry the objects of the calls above; reset says that events were
//        dropped and everything must be fetched again. Last-Event-ID is ignored: events carry the
//        present state, so a reader that reconnects fetches everything and continues.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "coordinator/core/job/job_verbs.h"
#include "coordinator/service/http/api/http_preview.h"
#include "coordinator/service/http/server/http_access.h"
#include "coordinator/service/http/server/http_router.h"
#include "coordinator/service/view/farm_view.h"
#include "coordinator/service/view/pixel_view.h"
#include "coordinator/service/view/server_metrics.h"

namespace sheaf::coordinator {

// The header with the range of a layer in false color: two numbers.
inline constexpr char kRangeHeader[] = "X-Sheaf-Range";
// Objects on a page of a list.
inline constexpr int kPageSizeDefault = 100;
inline constexpr int kPageSizeMax = 1000;

// How workers and clients other than browsers reach the coordinator.
struct FarmAddress {
  int grpc_port = 0;  // 0: it listens on none.
  bool tls = false;   // Whether every client needs a certificate.
};

// An image that is encoded for one request. version: for its ETag.
struct ViewedImage {
  std::string version;
  std::string png;
  std::optional<LayerRange> range;
};

// Actions on the farm that the page offers.
struct FarmActions {
  // Changes a job. Errors: those of the verb's function in coordinator/service/farm/jobs.
  std::function<absl::Status(JobVerb verb, const std::string& job_id,
                             const JobArguments& arguments)>
      change_job;
  // Drains a worker, or undoes that. Errors: those of WorkerDrains.
  std::function<absl::Status(const std::string& worker_id, bool drain)> drain_worker;
  // All channels of a pixel. Errors: those of Farm::ReadPixel.
  std::function<absl::StatusOr<PixelView>(const std::string& job_id, int32_t frame_number,
                                          int32_t x_px, int32_t y_px)>
      read_pixel;
  // May be null: no address is known.
  std::function<FarmAddress()> address;
  // Farm::CollectGarbage.
  std::function<absl::StatusOr<std::vector<RemovalView>>(bool dry_run)> collect_garbage;
  // Farm::ListUsage.
  std::function<absl::StatusOr<UsageReport>(const UsageQuery& query)> list_usage;
};

class HttpApi {
 public:
  // `farm` must outlive this object. `instance` identifies this run of the coordinator, so that
  // browsers do not use cached images of an earlier run.
  // access: decides who may change which job; null: every caller may. server: null: none. Both must
  // outlive this object.
  HttpApi(const FarmView& farm, FarmActions actions, std::string instance,
          const HttpAccess* access = nullptr, const ServerMetrics* server = nullptr);

  // The table above without the event stream, which the server itself provides. The functions refer
  // to this object. Thread safety: one thread at a time.
  std::vector<HttpRoute> Routes();

 private:
  HttpResponse ListJobs(const HttpRequest& request) const;
  HttpResponse GetJob(const HttpRequest& request) const;
  HttpResponse ListFailures(const HttpRequest& request) const;
  HttpResponse ListEvents(const HttpRequest& request) const;
  // Changes the job in the path, if the caller may, and responds with its new state.
  HttpResponse ChangeJob(const JobVerbRow& row, const HttpRequest& request) const;
  absl::Status TryChange(const JobVerbRow& row, const HttpRequest& request,
                         JobArguments arguments) const;
  HttpResponse GetRefinePrice(const HttpRequest& request) const;
  HttpResponse GetLayers(const HttpRequest& request) const;
  HttpResponse GetPixel(const HttpRequest& request) const;
  HttpResponse GetFarm() const;
  // Whether the request is for an image that View makes, not for a cached preview.
  static bool IsView(const HttpRequest& request);
  absl::StatusOr<ViewedImage> View(const HttpRequest& request, const FrameView& frame) const;
  absl::StatusOr<ViewedImage> ViewDifference(const HttpRequest& request,
                                             const FrameView& frame) const;
  // Drains the worker in the path, or undoes that, and responds with its new state.
  HttpResponse DrainWorker(bool drain, const HttpRequest& request) const;
  HttpResponse CollectGarbage(const HttpRequest& request) const;
  HttpResponse GetFrame(const HttpRequest& request) const;
  HttpResponse GetPreview(const HttpRequest& request);
  HttpResponse GetFalseColor() const;
  HttpResponse GetOutput(const HttpRequest& request) const;
  HttpResponse ListWorkers(const HttpRequest& request) const;
  HttpResponse ListCounters() const;
  // Finds the job and frame in the path. Errors: kNotFound, kInvalidArgument.
  absl::StatusOr<FrameView> FindFrame(const HttpRequest& request) const;
  absl::StatusOr<FrameView> FindFrame(const std::string& job_id, int32_t number) const;

  const FarmView& farm_;
  const FarmActions actions_;
  const std::string instance_;
  const HttpAccess* const access_;
  const ServerMetrics* const server_;
  PreviewCache previews_, thumbnails_{kThumbnailCacheCountMax};
};

HttpResponse JsonResponse(std::string json);
// Converts an error to a response. Requires: !status.ok().
HttpResponse HttpErrorFromStatus(const absl::Status& status);

}  // namespace sheaf::coordinator
