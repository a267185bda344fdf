// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The HTTP side's answers: health, metrics, and the farm as JSON and images.
//
//   GET  /healthz                                   200 while the process serves
//   GET  /readyz                                    200 where work is accepted, else 503 and why
//   GET  /metrics                                   Prometheus text
//   GET  /api/v1/jobs?page_size&page_token          jobs, newest first, without frames
//   GET  /api/v1/jobs/ID?page_size&page_token       one job with a page of its frames
//   GET  /api/v1/jobs/ID/failures                   leases that came to nothing, the last ones,
//        newest first, each with the command that renders its tile again on one machine
//   POST /api/v1/jobs/ID:cancel                     cancels; repeating it changes nothing
//   POST /api/v1/jobs/ID:pause, ID:resume           no new leases, or leases again; likewise
//   POST /api/v1/jobs/ID:priority?value=N           higher goes first, from -1000 to 1000; likewise
//   POST /api/v1/jobs/ID:refine?target_error=E&samples=N
//        refines a job that succeeded until its frames' relMSE is at most E, with at most N
//        samples a pixel; without E, with N samples; repeating it changes nothing
//   GET  /api/v1/jobs/ID/refine-price?target_error=E,E,...
//        what that costs beyond what is there, by the farm as it is now, for up to 32 errors
//   GET  /api/v1/jobs/ID/frames/N                   one frame
//   GET  /api/v1/jobs/ID/frames/N/preview.png?layer=NAME
//        the image so far; 204 where there is none. Layers: image, light, error, samples and
//        time, see image_layer.h; the last three come with X-Sheaf-Range: LOW HIGH, the ends of
//        their colors
//   GET  /api/v1/jobs/ID/frames/N/preview.png?size=thumbnail
//        the image so far, small; 204 where there is none
//   GET  /api/v1/jobs/ID/frames/N/preview.png?layer=NAME&round=R
//        a layer as it was at the end of a round, from 0, small; 404 where that is not kept, as the
//        frame's rounds[R].preview_version tells by 0
//   GET  /api/v1/false-color.png                    the false colors from low to high, one row
//   GET  /api/v1/jobs/ID/frames/N/output.exr        the delivered image
//   GET  /api/v1/workers?page_size&page_token       workers; all where no size is given
//   GET  /api/v1/counters                           the numbers of /metrics as JSON
//   GET  /api/v1/events                             what changes, as server-sent events: types job,
//        frame and worker carry the objects of the calls above, and reset says that some were left
//        out and everything should be fetched anew. Last-Event-ID is ignored: events state what is,
//        so a reader that reconnects fetches and continues.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "coordinator/service/http/http_preview.h"
#include "coordinator/service/http/http_router.h"
#include "coordinator/service/view/farm_view.h"

namespace sheaf::coordinator {

// The header that tells the range of a layer in false color: two numbers.
inline constexpr char kRangeHeader[] = "X-Sheaf-Range";
// Objects on a page of a list.
inline constexpr int kPageSizeDefault = 100;
inline constexpr int kPageSizeMax = 1000;

// The actions that the page offers on the farm.
struct FarmActions {
  // Cancels a job. Errors: kNotFound; kFailedPrecondition (it has ended).
  std::function<absl::Status(const std::string& job_id)> cancel_job;
  // The same of its pause, and of its priority, where kInvalidArgument is an error too.
  std::function<absl::Status(const std::string&job_id)> pause_job, resume_job;
  std::function<absl::Status(const std::string& job_id, int32_t priority)> set_job_priority;
  // Goes on with a job that succeeded. Errors: those of Farm::RefineJob.
  std::function<absl::Status(const std::string& job_id, const Refinement& refinement)> refine_job;
};

class HttpApi {
 public:
  // `farm` must outlive the object. `instance` tells this run of the coordinator from others, so
  // that a browser never takes an image of an earlier run for a present one.
  HttpApi(const FarmView& farm, FarmActions actions, std::string instance);

  // The table above, but for the event stream, which the server itself serves.
  // The functions refer to this object. Thread safety: from one thread at a time.
  std::vector<HttpRoute> Routes();

 private:
  HttpResponse Ready() const;
  HttpResponse ListJobs(const HttpRequest& request) const;
  HttpResponse GetJob(const HttpRequest& request) const;
  HttpResponse ListFailures(const HttpRequest& request) const;
  // Acts on the job that the path names and answers with the job as it is then.
  HttpResponse ChangeJob(const HttpRequest& request,
                         const std::function<absl::Status(const std::string&)>& act) const;
  HttpResponse SetPriority(const HttpRequest& request) const;
  HttpResponse RefineJob(const HttpRequest& request) const;  // These two in http_refine.cc.
  HttpResponse GetRefinePrice(const HttpRequest& request) const;
  HttpResponse GetFrame(const HttpRequest& request) const;
  HttpResponse GetPreview(const HttpRequest& request);
  HttpResponse GetFalseColor() const;
  HttpResponse GetOutput(const HttpRequest& request) const;
  HttpResponse ListWorkers(const HttpRequest& request) const;
  HttpResponse ListCounters() const;
  // The job and frame that the path names. Errors: kNotFound, kInvalidArgument.
  absl::StatusOr<FrameView> FindFrame(const HttpRequest& request) const;

  const FarmView& farm_;
  const FarmActions actions_;
  const std::string instance_;
  PreviewCache previews_, thumbnails_{kThumbnailCacheCountMax};
};

HttpResponse JsonResponse(std::string json);
// The response that tells of a status. Requires: !status.ok().
HttpResponse HttpErrorFromStatus(const absl::Status& status);

}  // namespace sheaf::coordinator
