// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of HttpApi that changes jobs: the verbs of job_verbs.h with their arguments.
#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "coordinator/service/http/api/http_api.h"
#include "coordinator/service/http/api/http_json.h"

namespace sheaf::coordinator {
namespace {

using Takes = JobVerbRow::Takes;

// Each reads the parameters of a kind. Errors: kInvalidArgument.
absl::Status ReadPriority(const HttpRequest& request, JobArguments* arguments) {
  const std::string text = QueryValue(request, "value");
  if (absl::SimpleAtoi(text, &arguments->priority)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("value \"", text, "\" is not an integer"));
}

absl::Status ReadTasks(const HttpRequest& request, JobArguments* arguments) {
  const std::string frame = QueryValue(request, "frame");
  const std::string task = QueryValue(request, "task");
  if (int32_t number = 0; !frame.empty()) {
    if (!absl::SimpleAtoi(frame, &number)) {
      return absl::InvalidArgumentError(absl::StrCat("frame \"", frame, "\" is not an integer"));
    }
    arguments->frame = number;
  }
  if (uint32_t number = 0; !task.empty()) {
    if (!absl::SimpleAtoi(task, &number)) {
      return absl::InvalidArgumentError(
          absl::StrCat("task \"", task, "\" is not an integer of 0 or more"));
    }
    arguments->task = number;
  }
  if (arguments->task && !arguments->frame) {
    return absl::InvalidArgumentError("task=N needs its frame: frame=N");
  }
  return absl::OkStatus();
}

absl::Status ReadTasksOfFrame(const HttpRequest& request, JobArguments* arguments) {
  if (absl::Status read = ReadTasks(request, arguments); !read.ok()) return read;
  if (arguments->frame) return absl::OkStatus();
  return absl::InvalidArgumentError("frame=N is missing; :cancel ends a whole job");
}

absl::Status ReadFrames(const HttpRequest& request, JobArguments* arguments) {
  for (const absl::string_view word :
       absl::StrSplit(QueryValue(request, "frames"), ',', absl::SkipEmpty())) {
    int32_t number = 0;
    if (!absl::SimpleAtoi(word, &number)) {
      return absl::InvalidArgumentError(
          absl::StrCat("frames: \"", word, "\" is not an integer; list numbers, as in 3,5"));
    }
    arguments->frames.push_back(number);
  }
  return absl::OkStatus();
}

absl::StatusOr<double> TargetError(absl::string_view text) {
  double target = 0;
  if (absl::SimpleAtod(text, &target) && target > 0 && target <= kTargetErrorMax) return target;
  return absl::InvalidArgumentError(absl::StrCat(
      "target_error \"", text, "\" is not a number above 0 and at most ", kTargetErrorMax));
}

absl::Status ReadRefinement(const HttpRequest& request, JobArguments* arguments) {
  const std::string target = QueryValue(request, "target_error");
  const std::string samples = QueryValue(request, "samples");
  if (target.empty() && samples.empty()) {
    return absl::InvalidArgumentError("a refinement needs target_error=E, samples=N or both");
  }
  Refinement& refinement = arguments->refinement;
  if (!target.empty()) {
    const absl::StatusOr<double> error = TargetError(target);
    if (!error.ok()) return error.status();
    refinement.stop.target_error = *error;
  }
  if (!samples.empty() &&
      (!absl::SimpleAtoi(samples, &refinement.samples) || refinement.samples == 0)) {
    return absl::InvalidArgumentError(
        absl::StrCat("samples \"", samples, "\" is not an integer above 0"));
  }
  return absl::OkStatus();
}

absl::Status ReadArguments(Takes takes, const HttpRequest& request, JobArguments* arguments) {
  switch (takes) {
    case Takes::kNone:
      return absl::OkStatus();
    case Takes::kPriority:
      return ReadPriority(request, arguments);
    case Takes::kTasks:
      return ReadTasks(request, arguments);
    case Takes::kTasksOfFrame:
      return ReadTasksOfFrame(request, arguments);
    case Takes::kFrames:
      return ReadFrames(request, arguments);
    case Takes::kRefinement:
      return ReadRefinement(request, arguments);
  }
  return absl::InternalError("unknown arguments");
}

}  // namespace

absl::Status HttpApi::TryChange(const JobVerbRow& row, const HttpRequest& request,
                                JobArguments arguments) const {
  const std::string& job_id = request.path_parameters[0];
  if (access_ != nullptr) {
    const absl::StatusOr<JobView> job = farm_.FindJob(job_id);
    if (!job.ok()) return job.status();
    absl::Status allowed = AccessControl::AuthorizeJob(request.caller, job->owner);
    if (!allowed.ok()) return allowed;
  }
  if (row.takes == Takes::kRefinement && arguments.refinement.samples == 0) {
    const absl::StatusOr<JobView> job = farm_.FindJob(job_id);
    if (!job.ok()) return job.status();
    uint64_t& samples = arguments.refinement.samples;
    samples = kStoppedSamplesMax;
    for (const FrameView& frame : job->frames) samples = std::max(samples, frame.settings.samples);
  }
  return actions_.change_job(row.verb, job_id, arguments);
}

HttpResponse HttpApi::ChangeJob(const JobVerbRow& row, const HttpRequest& request) const {
  const std::string& job_id = request.path_parameters[0];
  const std::optional<Identity>& identity = request.caller.identity;
  JobArguments arguments;
  arguments.user = identity ? identity->id.name : kLocalOwner;
  if (absl::Status read = ReadArguments(row.takes, request, &arguments); !read.ok()) {
    return HttpErrorFromStatus(read);
  }
  const absl::Status done = TryChange(row, request, std::move(arguments));
  if (access_ != nullptr) access_->NoteInAudit(request, job_id, done);
  if (!done.ok()) return HttpErrorFromStatus(done);
  if (row.verb == JobVerb::kDeleteJob) return JsonResponse(NameJson(absl::StrCat("jobs/", job_id)));
  const absl::StatusOr<JobView> job = farm_.FindJob(job_id);
  if (!job.ok()) return HttpErrorFromStatus(job.status());
  return JsonResponse(JobJson(*job, JsonFields::kHttp));
}

HttpResponse HttpApi::GetRefinePrice(const HttpRequest& request) const {
  std::vector<double> targets;
  for (const absl::string_view text : absl::StrSplit(QueryValue(request, "target_error"), ',')) {
    const absl::StatusOr<double> target = TargetError(text);
    if (!target.ok()) return HttpErrorFromStatus(target.status());
    targets.push_back(*target);
  }
  const absl::StatusOr<RefinementPrices> prices =
      farm_.PriceRefinement(request.path_parameters[0], targets);
  if (!prices.ok()) return HttpErrorFromStatus(prices.status());
  return JsonResponse(RefinementPricesJson(*prices));
}

HttpResponse HttpApi::DrainWorker(bool drain, const HttpRequest& request) const {
  const std::string& worker_id = request.path_parameters[0];
  const absl::Status done = actions_.drain_worker(worker_id, drain);
  if (access_ != nullptr) {
    access_->NoteActInAudit(request, absl::StrCat("workers/", worker_id), done);
  }
  if (!done.ok()) return HttpErrorFromStatus(done);
  for (const WorkerView& worker : farm_.ListWorkers()) {
    if (worker.worker_id == worker_id) return JsonResponse(WorkerJson(worker, JsonFields::kHttp));
  }
  return HttpErrorFromStatus(
      absl::NotFoundError(absl::StrCat("workers/", worker_id, ": there is no such worker")));
}

}  // namespace sheaf::coordinator
