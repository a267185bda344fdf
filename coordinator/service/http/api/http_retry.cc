// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of HttpApi that retries failed work, gives it up, or approves frames.
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "coordinator/service/http/api/http_api.h"

namespace sheaf::coordinator {
namespace {

struct ChosenTasks {
  std::optional<int32_t> frame;
  std::optional<uint32_t> task;
};

// Errors: kInvalidArgument.
absl::StatusOr<ChosenTasks> ChosenBy(const HttpRequest& request) {
  const std::string frame = QueryValue(request, "frame");
  const std::string task = QueryValue(request, "task");
  ChosenTasks chosen;
  if (int32_t number = 0; !frame.empty()) {
    if (!absl::SimpleAtoi(frame, &number)) {
      return absl::InvalidArgumentError(absl::StrCat("frame \"", frame, "\" is not an integer"));
    }
    chosen.frame = number;
  }
  if (uint32_t number = 0; !task.empty()) {
    if (!absl::SimpleAtoi(task, &number)) {
      return absl::InvalidArgumentError(
          absl::StrCat("task \"", task, "\" is not an integer of 0 or more"));
    }
    chosen.task = number;
  }
  if (chosen.task && !chosen.frame) {
    return absl::InvalidArgumentError("task=N needs its frame: frame=N");
  }
  return chosen;
}

}  // namespace

HttpResponse HttpApi::RetryTasks(const HttpRequest& request) const {
  const absl::StatusOr<ChosenTasks> chosen = ChosenBy(request);
  if (!chosen.ok()) return HttpErrorFromStatus(chosen.status());
  return ChangeJob(request, [&](const std::string& job_id) {
    return actions_.retry_tasks(job_id, chosen->frame, chosen->task);
  });
}

HttpResponse HttpApi::KillTasks(const HttpRequest& request) const {
  const absl::StatusOr<ChosenTasks> chosen = ChosenBy(request);
  if (!chosen.ok()) return HttpErrorFromStatus(chosen.status());
  if (!chosen->frame) {
    return HttpErrorFromStatus(
        absl::InvalidArgumentError("frame=N is missing; :cancel ends a whole job"));
  }
  const std::optional<Identity>& identity = request.caller.identity;
  const std::string why = absl::StrCat("killed by ", identity ? identity->id.name : kLocalOwner);
  return ChangeJob(request, [&](const std::string& job_id) {
    return actions_.kill_tasks(job_id, *chosen->frame, chosen->task, why);
  });
}

HttpResponse HttpApi::ApproveFrames(const HttpRequest& request) const {
  const std::string text = QueryValue(request, "frames");
  std::vector<int32_t> frames;
  for (const absl::string_view word : absl::StrSplit(text, ',', absl::SkipEmpty())) {
    int32_t number = 0;
    if (!absl::SimpleAtoi(word, &number)) {
      return HttpErrorFromStatus(absl::InvalidArgumentError(
          absl::StrCat("frames: \"", word, "\" is not an integer; list numbers, as in 3,5")));
    }
    frames.push_back(number);
  }
  return ChangeJob(
      request, [&](const std::string& job_id) { return actions_.approve_frames(job_id, frames); });
}

}  // namespace sheaf::coordinator
