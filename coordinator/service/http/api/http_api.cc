// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// One function per endpoint, over FarmView.
#include "coordinator/service/http/api/http_api.h"

#include <algorithm>
#include <limits>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "coordinator/service/http/api/http_json.h"
#include "coordinator/service/http/api/http_metrics.h"
#include "coordinator/service/http/api/http_operations.h"
#include "coordinator/service/http/image/false_color.h"

namespace sheaf::coordinator {
namespace {

int HttpStatusFromCode(absl::StatusCode code) {
  switch (code) {
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kOutOfRange:
      return 400;
    case absl::StatusCode::kUnauthenticated:
      return 401;
    case absl::StatusCode::kPermissionDenied:
      return 403;
    case absl::StatusCode::kNotFound:
      return 404;
    case absl::StatusCode::kAborted:
    case absl::StatusCode::kAlreadyExists:
    case absl::StatusCode::kFailedPrecondition:
      return 409;
    case absl::StatusCode::kResourceExhausted:
      return 429;
    case absl::StatusCode::kUnavailable:
      return 503;
    default:
      return 500;
  }
}

// The page size that a request specifies. Errors: kInvalidArgument.
absl::StatusOr<int> PageSize(const HttpRequest& request, int default_size) {
  const std::string text = QueryValue(request, "page_size");
  if (text.empty()) return default_size;
  int size = 0;
  if (!absl::SimpleAtoi(text, &size) || size < 1 || size > kPageSizeMax) {
    return absl::InvalidArgumentError(
        absl::StrCat("page_size \"", text, "\" is not a number from 1 to ", kPageSizeMax));
  }
  return size;
}

absl::Status UnknownPageToken(const std::string& token) {
  return absl::InvalidArgumentError(
      absl::StrCat("page_token \"", token, "\" is unknown; start again without one"));
}

// The name of a downloaded file: letters, digits, dots and hyphens of the title.
std::string DownloadName(const std::string& title, int32_t frame_number) {
  std::string name;
  for (const char c : title.substr(0, 80)) {
    name.push_back(
        absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '.' || c == '-' ? c : '_');
  }
  return absl::StrFormat("%s.%04d.exr", name.empty() ? "sheaf" : name, frame_number);
}

// Whether the client already has this version.
bool ClientHas(const HttpRequest& request, const std::string& etag) {
  return HeaderValue(request, "If-None-Match") == etag;
}

HttpResponse NotModified(const std::string& etag) {
  HttpResponse response;
  response.status = 304;
  response.headers = {{"ETag", etag}, {"Cache-Control", "no-cache"}};
  return response;
}

// Errors: kInvalidArgument.
absl::StatusOr<PreviewChoice> ChoiceOf(const HttpRequest& request) {
  const std::string name = QueryValue(request, "layer");
  const std::optional<ImageLayer> layer = ImageLayerFromName(name);
  if (!layer) {
    return absl::InvalidArgumentError(
        absl::StrCat("layer \"", name, "\" is not one of image, light, error, samples, time"));
  }
  const std::string size = QueryValue(request, "size");
  const bool thumbnail = size == "thumbnail";
  if (!size.empty() && (!thumbnail || *layer != ImageLayer::kImage)) {
    return absl::InvalidArgumentError("other sizes are thumbnail and full, for layer image only");
  }
  PreviewChoice choice{*layer, thumbnail, std::nullopt};
  const std::string round = QueryValue(request, "round");
  if (round.empty()) return choice;
  int32_t number = 0;
  if (!absl::SimpleAtoi(round, &number) || number < 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("round \"", round, "\" is not a number of 0 or more"));
  }
  if (thumbnail || *layer == ImageLayer::kTime) {
    return absl::InvalidArgumentError("rounds have no thumbnails and no layer \"time\"");
  }
  choice.round = number;
  return choice;
}

HttpResponse ViewResponse(const HttpRequest& request, const absl::StatusOr<ViewedImage>& image) {
  if (!image.ok()) return HttpErrorFromStatus(image.status());
  const std::string etag = absl::StrCat("\"", image->version, "\"");
  if (ClientHas(request, etag)) return NotModified(etag);
  HttpResponse response;
  response.content_type = "image/png";
  response.headers = {{"ETag", etag}, {"Cache-Control", "no-cache"}};
  if (image->range) {
    response.headers.emplace_back(kRangeHeader,
                                  absl::StrCat(image->range->low, " ", image->range->high));
  }
  response.body = image->png;
  return response;
}

}  // namespace

HttpResponse JsonResponse(std::string json) {
  HttpResponse response;
  response.content_type = "application/json";
  response.headers = {{"Cache-Control", "no-store"}};
  response.body = std::move(json);
  response.body.push_back('\n');
  return response;
}

HttpResponse HttpErrorFromStatus(const absl::Status& status) {
  return HttpError(HttpStatusFromCode(status.code()), absl::StatusCodeToString(status.code()),
                   std::string(status.message()));
}

HttpApi::HttpApi(const FarmView& farm, FarmActions actions, std::string instance,
                 const HttpAccess* access, const ServerMetrics* server)
    : farm_(farm),
      actions_(std::move(actions)),
      instance_(std::move(instance)),
      access_(access),
      server_(server) {}

std::vector<HttpRoute> HttpApi::Routes() {
  using Request = HttpRequest;
  const auto metrics = [this](const Request&) {
    HttpResponse response;
    response.content_type = kPrometheusContentType;
    response.body = PrometheusText(MetricsOf(farm_, access_, server_));
    return response;
  };
  const auto probe = [](const char* path, HttpFunction answer) {
    HttpRoute route{"GET", path, std::move(answer)};
    route.is_probe = true;
    return route;
  };
  const std::string job = "/api/v1/jobs/{}";
  const std::string frame = job + "/frames/{}";
  std::vector<HttpRoute> routes = {
      probe("/healthz", [](const Request&) { return JsonResponse(HealthJson()); }),
      probe("/readyz",
            [this](const Request&) { return ReadyResponse(ConditionsOf(farm_, access_)); }),
      probe("/metrics", metrics),
      {"GET", "/api/v1/jobs", [this](const Request& r) { return ListJobs(r); }},
      {"GET", job, [this](const Request& r) { return GetJob(r); }},
      {"GET", job + "/failures", [this](const Request& r) { return ListFailures(r); }},
      {"GET", job + "/log", [this](const Request& r) { return ListEvents(r); }},
      {"POST", "/api/v1/gc", [this](const Request& r) { return CollectGarbage(r); }},
      {"GET", job + "/refine-price", [this](const Request& r) { return GetRefinePrice(r); }},
      {"GET", frame, [this](const Request& r) { return GetFrame(r); }},
      {"GET", frame + "/preview.png", [this](const Request& r) { return GetPreview(r); }},
      {"GET", frame + "/layers", [this](const Request& r) { return GetLayers(r); }},
      {"GET", frame + "/pixel", [this](const Request& r) { return GetPixel(r); }},
      {"GET", "/api/v1/farm", [this](const Request&) { return GetFarm(); }},
      {"GET", "/api/v1/false-color.png", [this](const Request&) { return GetFalseColor(); }},
      {"GET", frame + "/output.exr", [this](const Request& r) { return GetOutput(r); }},
      {"GET", "/api/v1/workers", [this](const Request& r) { return ListWorkers(r); }},
      {"POST", "/api/v1/workers/{}:drain",
       [this](const Request& r) { return DrainWorker(true, r); }},
      {"POST", "/api/v1/workers/{}:undrain",
       [this](const Request& r) { return DrainWorker(false, r); }},
      {"GET", "/api/v1/session",
       [](const Request& r) { return JsonResponse(SessionJson(r.caller)); }},
      {"GET", "/api/v1/usage", [this](const Request& r) { return UsageResponse(actions_, r); }},
      {"GET", "/api/v1/counters", [this](const Request&) { return ListCounters(); }},
  };
  for (const JobVerbRow& row : kJobVerbs) {
    routes.push_back({"POST", absl::StrCat(job, ":", row.word),
                      [this, &row](const Request& r) { return ChangeJob(row, r); }});
  }
  return routes;
}

HttpResponse HttpApi::ListJobs(const HttpRequest& request) const {
  const absl::StatusOr<int> size = PageSize(request, kPageSizeDefault);
  if (!size.ok()) return HttpErrorFromStatus(size.status());
  const std::vector<JobView> jobs = farm_.ListJobs();
  auto job = jobs.begin();
  // A token is the last job of the previous page. New jobs come first, so they do not shift later
  // pages.
  const std::string token = QueryValue(request, "page_token");
  if (!token.empty()) {
    job = std::find_if(jobs.begin(), jobs.end(),
                       [&](const JobView& candidate) { return candidate.job_id == token; });
    if (job == jobs.end()) return HttpErrorFromStatus(UnknownPageToken(token));
    ++job;
  }
  std::vector<std::string> page;
  for (; job != jobs.end() && page.size() < static_cast<size_t>(*size); ++job) {
    page.push_back(JobJson(*job, JsonFields::kHttp));
  }
  return JsonResponse(ListJson("jobs", page, job == jobs.end() ? "" : std::prev(job)->job_id));
}

HttpResponse HttpApi::GetJob(const HttpRequest& request) const {
  const absl::StatusOr<int> size = PageSize(request, kPageSizeMax);
  if (!size.ok()) return HttpErrorFromStatus(size.status());
  const absl::StatusOr<JobView> job = farm_.FindJob(request.path_parameters[0]);
  if (!job.ok()) return HttpErrorFromStatus(job.status());
  auto frame = job->frames.begin();
  const std::string token = QueryValue(request, "page_token");
  if (!token.empty()) {
    int32_t last = 0;
    if (!absl::SimpleAtoi(token, &last)) return HttpErrorFromStatus(UnknownPageToken(token));
    frame = std::find_if(job->frames.begin(), job->frames.end(),
                         [&](const FrameView& f) { return f.frame_number > last; });
  }
  std::vector<std::string> page;
  for (; frame != job->frames.end() && page.size() < static_cast<size_t>(*size); ++frame) {
    page.push_back(FrameJson(job->job_id, *frame, JsonFields::kHttp));
  }
  const bool ended = frame == job->frames.end();
  return JsonResponse(JobWithFramesJson(*job, page, JsonFields::kHttp,
                                        ended ? "" : absl::StrCat(std::prev(frame)->frame_number)));
}

HttpResponse HttpApi::ListFailures(const HttpRequest& request) const {
  const std::string& job_id = request.path_parameters[0];
  const absl::StatusOr<std::vector<FailureView>> failures = farm_.ListFailures(job_id);
  if (!failures.ok()) return HttpErrorFromStatus(failures.status());
  std::vector<std::string> list;
  for (const FailureView& failure : *failures) list.push_back(FailureJson(job_id, failure));
  return JsonResponse(ListJson("failures", list, ""));
}

HttpResponse HttpApi::ListEvents(const HttpRequest& request) const {
  const absl::StatusOr<std::vector<JobEvent>> events = farm_.ListEvents(request.path_parameters[0]);
  if (!events.ok()) return HttpErrorFromStatus(events.status());
  std::vector<std::string> list;
  for (const JobEvent& event : *events) list.push_back(EventJson(event));
  return JsonResponse(ListJson("events", list, ""));
}

HttpResponse HttpApi::CollectGarbage(const HttpRequest& request) const {
  const std::string text = QueryValue(request, "dry_run");
  if (!text.empty() && text != "0" && text != "1") {
    return HttpErrorFromStatus(
        absl::InvalidArgumentError(absl::StrCat("dry_run \"", text, "\" is neither 0 nor 1")));
  }
  const bool dry_run = text == "1";
  const absl::StatusOr<std::vector<RemovalView>> removals = actions_.collect_garbage(dry_run);
  if (access_ != nullptr && !dry_run) {
    const std::string what =
        removals.ok() ? absl::StrCat(removals->size(), " removals") : std::string("nothing");
    access_->NoteActInAudit(request, what, removals.status());
  }
  if (!removals.ok()) return HttpErrorFromStatus(removals.status());
  std::vector<std::string> list;
  for (const RemovalView& removal : *removals) list.push_back(RemovalJson(removal));
  return JsonResponse(ListJson("removals", list, ""));
}

absl::StatusOr<FrameView> HttpApi::FindFrame(const HttpRequest& request) const {
  const std::string& job_id = request.path_parameters[0];
  const std::string& number_text = request.path_parameters[1];
  int32_t number = 0;
  if (!absl::SimpleAtoi(number_text, &number)) {
    return absl::InvalidArgumentError(absl::StrCat("\"", number_text, "\" is not a frame number"));
  }
  return FindFrame(job_id, number);
}

absl::StatusOr<FrameView> HttpApi::FindFrame(const std::string& job_id, int32_t number) const {
  const absl::StatusOr<JobView> job = farm_.FindJob(job_id);
  if (!job.ok()) return job.status();
  for (const FrameView& frame : job->frames) {
    if (frame.frame_number == number) return frame;
  }
  return absl::NotFoundError(absl::StrCat("jobs/", job_id, " has no frame ", number));
}

HttpResponse HttpApi::GetFrame(const HttpRequest& request) const {
  const absl::StatusOr<FrameView> frame = FindFrame(request);
  if (!frame.ok()) return HttpErrorFromStatus(frame.status());
  return JsonResponse(FrameJson(request.path_parameters[0], *frame, JsonFields::kHttp));
}

HttpResponse HttpApi::GetPreview(const HttpRequest& request) {
  HttpResponse no_image;
  no_image.status = 204;
  no_image.headers = {{"Cache-Control", "no-store"}};
  const absl::StatusOr<PreviewChoice> choice = ChoiceOf(request);
  const absl::StatusOr<FrameView> frame = FindFrame(request);
  // A list asks for the thumbnails of its rows after it was read: a job may be deleted between.
  if (absl::IsNotFound(frame.status()) && choice.ok() && choice->thumbnail) return no_image;
  if (!frame.ok()) return HttpErrorFromStatus(frame.status());
  if (IsView(request)) return ViewResponse(request, View(request, *frame));
  if (!choice.ok()) return HttpErrorFromStatus(choice.status());
  const auto etag = [&](uint64_t version) {
    return absl::StrCat("\"", instance_, "-", version, "\"");
  };
  const uint64_t newest = PreviewCache::VersionOf(*frame, *choice);
  if (ClientHas(request, etag(newest))) return NotModified(etag(newest));
  absl::StatusOr<EncodedPreview> preview =
      (choice->thumbnail ? thumbnails_ : previews_)
          .Find(farm_, request.path_parameters[0], *frame, *choice);
  const bool may_lack = !frame->complete || choice->thumbnail || choice->layer == ImageLayer::kTime;
  // This is not an error: a job may end between the event that announces an image and the request
  // for it, a thumbnail may not have been stored, and frames without parts have no times.
  if (absl::IsUnavailable(preview.status()) && may_lack) return no_image;
  if (!preview.ok()) return HttpErrorFromStatus(preview.status());
  HttpResponse response;
  response.content_type = "image/png";
  response.headers = {{"ETag", etag(preview->version)}, {"Cache-Control", "no-cache"}};
  if (preview->range) {
    response.headers.emplace_back(kRangeHeader,
                                  absl::StrCat(preview->range->low, " ", preview->range->high));
  }
  response.body = std::move(preview->png);
  return response;
}

HttpResponse HttpApi::GetFalseColor() const {
  constexpr int kWidthPx = 256;
  std::vector<Rgb8> row;
  for (int x = 0; x < kWidthPx; ++x) row.push_back(Viridis(x / (kWidthPx - 1.0)));
  absl::StatusOr<std::string> png = EncodePng(kWidthPx, 1, row);
  if (!png.ok()) return HttpErrorFromStatus(png.status());
  HttpResponse response;
  response.content_type = "image/png";
  response.headers = {{"Cache-Control", "no-cache"}};
  response.body = *std::move(png);
  return response;
}

HttpResponse HttpApi::GetOutput(const HttpRequest& request) const {
  const absl::StatusOr<FrameView> frame = FindFrame(request);
  if (!frame.ok()) return HttpErrorFromStatus(frame.status());
  if (!frame->complete) {
    return HttpErrorFromStatus(absl::FailedPreconditionError(
        absl::StrCat("frame ", frame->frame_number, " is not complete yet; see preview.png")));
  }
  const std::string etag = absl::StrCat("\"", frame->image_digest, "\"");
  if (ClientHas(request, etag)) return NotModified(etag);
  const absl::StatusOr<JobView> job = farm_.FindJob(request.path_parameters[0]);
  if (!job.ok()) return HttpErrorFromStatus(job.status());
  HttpResponse response;
  response.content_type = "image/x-exr";
  response.headers = {
      {"ETag", etag},
      {"Cache-Control", "no-cache"},
      {"Content-Disposition", absl::StrCat("attachment; filename=\"",
                                           DownloadName(job->title, frame->frame_number), "\"")}};
  response.file_path = frame->output_path;
  return response;
}

HttpResponse HttpApi::ListWorkers(const HttpRequest& request) const {
  const absl::StatusOr<int> size = PageSize(request, std::numeric_limits<int>::max());
  if (!size.ok()) return HttpErrorFromStatus(size.status());
  // A token is the last worker of the previous page, whether or not it still exists.
  const std::string token = QueryValue(request, "page_token");
  std::vector<std::string> page;
  std::string last;
  for (const WorkerView& worker : farm_.ListWorkers()) {
    if (worker.worker_id <= token) continue;
    if (page.size() == static_cast<size_t>(*size)) {
      return JsonResponse(ListJson("workers", page, last));
    }
    page.push_back(WorkerJson(worker, JsonFields::kHttp));
    last = worker.worker_id;
  }
  return JsonResponse(ListJson("workers", page, ""));
}

HttpResponse HttpApi::ListCounters() const {
  std::vector<std::string> counters;
  for (const MetricView& metric : MetricsOf(farm_, access_, server_)) {
    if (metric.kind != MetricView::Kind::kHistogram) counters.push_back(MetricJson(metric));
  }
  return JsonResponse(ListJson("counters", counters, ""));
}

}  // namespace sheaf::coordinator
