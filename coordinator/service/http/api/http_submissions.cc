// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/http/api/http_submissions.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "coordinator/core/job/job.h"
#include "coordinator/service/http/api/http_api.h"

namespace sheaf::coordinator {
namespace {

using SubmissionJson = nlohmann::ordered_json;

constexpr char kNoDesk[] = "this coordinator takes no dropped scenes";

HttpResponse JsonAnswer(const SubmissionJson& json) {
  return JsonResponse(json.dump(-1, ' ', false, SubmissionJson::error_handler_t::replace));
}

HttpResponse ViewAnswer(const absl::StatusOr<SubmissionView>& view) {
  if (!view.ok()) return HttpErrorFromStatus(view.status());
  const bool has_job = !view->job_id.empty();
  return JsonAnswer(SubmissionJson{
      {"name", absl::StrCat("submissions/", view->id)},
      {"state", SubmissionStateName(view->state)},
      {"file_count", view->file_count},
      {"received_bytes", view->received_bytes},
      {"scenes", view->scenes},
      {"messages", view->messages},
      {"job", has_job ? SubmissionJson(absl::StrCat("jobs/", view->job_id)) : SubmissionJson()},
  });
}

SubmissionCaller CallerOfRequest(const HttpRequest& request) {
  const std::optional<Identity>& identity = request.caller.identity;
  const std::string name = identity ? request.caller.Name() : kLocalOwner;
  return {identity ? identity->id.name : kLocalOwner, absl::StrCat(name, " at ", request.peer)};
}

// Errors: kInvalidArgument.
absl::Status ParseCount(const HttpRequest& request, const char* name, uint64_t* count) {
  const std::string text = QueryValue(request, name);
  if (text.empty() || absl::SimpleAtoi(text, count)) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(name, " \"", text, "\" is not an integer of 0 or more"));
}

// Errors: kInvalidArgument.
absl::StatusOr<SubmissionWish> WishOf(const HttpRequest& request) {
  SubmissionWish wish;
  wish.scene = QueryValue(request, "scene");
  wish.title = QueryValue(request, "title");
  if (absl::Status status = ParseCount(request, "samples", &wish.samples); !status.ok()) {
    return status;
  }
  const std::string error = QueryValue(request, "target_error");
  const bool is_number = error.empty() || absl::SimpleAtod(error, &wish.target_error);
  if (!is_number || !std::isfinite(wish.target_error) || wish.target_error < 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("target_error \"", error, "\" is not a number of 0 or more"));
  }
  return wish;
}

}  // namespace

std::vector<HttpRoute> HttpSubmissions::Routes() const {
  const std::string all = "/api/v1/submissions";
  const std::string one = all + "/{}";
  HttpRoute append{"POST", one + "/files", [this](const HttpRequest& r) { return Append(r); }};
  append.body_bytes_max = kHttpLargeBodyBytesMax;
  return {{"GET", all, [this](const HttpRequest&) { return Offer(); }},
          {"GET", one, [this](const HttpRequest& r) { return Find(r); }},
          {"POST", all, [this](const HttpRequest& r) { return Begin(r); }},
          append,
          {"POST", one + ":read", [this](const HttpRequest& r) { return Read(r); }},
          {"POST", one + ":discard", [this](const HttpRequest& r) { return Discard(r); }}};
}

HttpResponse HttpSubmissions::Offer() const {
  const SubmissionOffer offer =
      desk_ == nullptr ? SubmissionOffer{.why_not = kNoDesk} : desk_->Offer();
  return JsonAnswer(SubmissionJson{{"why_not", offer.why_not},
                                   {"bytes_max", offer.bytes_max},
                                   {"files_max", offer.files_max},
                                   {"piece_bytes_max", offer.piece_bytes_max}});
}

HttpResponse HttpSubmissions::Begin(const HttpRequest& request) const {
  if (desk_ == nullptr) return HttpErrorFromStatus(absl::FailedPreconditionError(kNoDesk));
  return ViewAnswer(desk_->Begin(CallerOfRequest(request)));
}

HttpResponse HttpSubmissions::Append(const HttpRequest& request) const {
  if (desk_ == nullptr) return HttpErrorFromStatus(absl::FailedPreconditionError(kNoDesk));
  uint64_t offset = 0;
  if (absl::Status status = ParseCount(request, "offset", &offset); !status.ok()) {
    return HttpErrorFromStatus(status);
  }
  const absl::StatusOr<uint64_t> size =
      desk_->Append(CallerOfRequest(request), request.path_parameters[0],
                    QueryValue(request, "name"), offset, request.body);
  if (!size.ok()) return HttpErrorFromStatus(size.status());
  return JsonAnswer(SubmissionJson::object({{"size_bytes", *size}}));
}

HttpResponse HttpSubmissions::Read(const HttpRequest& request) const {
  if (desk_ == nullptr) return HttpErrorFromStatus(absl::FailedPreconditionError(kNoDesk));
  const absl::StatusOr<SubmissionWish> wish = WishOf(request);
  if (!wish.ok()) return HttpErrorFromStatus(wish.status());
  return ViewAnswer(desk_->Read(CallerOfRequest(request), request.path_parameters[0], *wish));
}

HttpResponse HttpSubmissions::Find(const HttpRequest& request) const {
  if (desk_ == nullptr) return HttpErrorFromStatus(absl::NotFoundError(kNoDesk));
  return ViewAnswer(desk_->Find(CallerOfRequest(request), request.path_parameters[0]));
}

HttpResponse HttpSubmissions::Discard(const HttpRequest& request) const {
  if (desk_ == nullptr) return HttpErrorFromStatus(absl::NotFoundError(kNoDesk));
  const absl::Status status = desk_->Discard(CallerOfRequest(request), request.path_parameters[0]);
  return status.ok() ? JsonAnswer(SubmissionJson::object()) : HttpErrorFromStatus(status);
}

}  // namespace sheaf::coordinator
