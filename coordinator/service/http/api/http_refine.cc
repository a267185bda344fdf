// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of HttpApi that refines finished jobs and estimates the cost.
#include <algorithm>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "coordinator/service/http/api/http_api.h"
#include "coordinator/service/http/api/http_json.h"

namespace sheaf::coordinator {
namespace {

// Errors: kInvalidArgument.
absl::StatusOr<double> TargetError(absl::string_view text) {
  double target = 0;
  if (absl::SimpleAtod(text, &target) && target > 0 && target <= kTargetErrorMax) return target;
  return absl::InvalidArgumentError(absl::StrCat(
      "target_error \"", text, "\" is not a number above 0 and at most ", kTargetErrorMax));
}

absl::StatusOr<Refinement> RefinementOf(const HttpRequest& request) {
  const std::string target = QueryValue(request, "target_error");
  const std::string samples = QueryValue(request, "samples");
  if (target.empty() && samples.empty()) {
    return absl::InvalidArgumentError("a refinement needs target_error=E, samples=N or both");
  }
  Refinement refinement;
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
  return refinement;
}

}  // namespace

HttpResponse HttpApi::RefineJob(const HttpRequest& request) const {
  absl::StatusOr<Refinement> refinement = RefinementOf(request);
  if (!refinement.ok()) return HttpErrorFromStatus(refinement.status());
  return ChangeJob(request, [&](const std::string& job_id) -> absl::Status {
    const absl::StatusOr<JobView> job = farm_.FindJob(job_id);
    if (!job.ok()) return job.status();
    if (refinement->samples == 0) {
      refinement->samples = kStoppedSamplesMax;
      for (const FrameView& frame : job->frames) {
        refinement->samples = std::max(refinement->samples, frame.settings.samples);
      }
    }
    return actions_.refine_job(job_id, *refinement);
  });
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

}  // namespace sheaf::coordinator
