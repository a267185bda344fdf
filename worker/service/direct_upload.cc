// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/service/direct_upload.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/log.h"
#include "common/base/printable.h"

namespace sheaf::worker {
namespace {

constexpr size_t kAnswerShownMax = 200;

bool IsStored(int status) {
  // 412: an earlier attempt, whose answer was lost, has stored it.
  return (status >= 200 && status < 300) || status == 412;
}

}  // namespace

std::vector<bool> DirectUpload::Store(const std::vector<const FinishedPart*>& parts,
                                      const Plan& plan) {
  std::vector<bool> stored(parts.size(), false);
  if (!is_wanted_ || is_aborted_ || IsPaused()) return stored;
  std::vector<const FinishedPart*> large;
  std::vector<size_t> indices;
  for (size_t i = 0; i < parts.size(); ++i) {
    if (parts[i]->exr_bytes.size() < kDirectUploadBytesMin) continue;
    large.push_back(parts[i]);
    indices.push_back(i);
  }
  if (large.empty()) return stored;
  const absl::StatusOr<std::vector<PutTicket>> tickets = plan(large);
  // The coordinator tells what is wrong when it gets the results.
  if (!tickets.ok() || tickets->size() != large.size()) return stored;
  for (size_t i = 0; i < large.size(); ++i) {
    if ((*tickets)[i].url.empty()) continue;
    const absl::Status put = Put((*tickets)[i], large[i]->exr_bytes);
    if (!put.ok()) {
      Pause(std::string(put.message()));
      break;
    }
    stored[indices[i]] = true;
  }
  return stored;
}

absl::Status DirectUpload::Put(const PutTicket& ticket, const std::string& bytes) {
  HttpRequest request;
  request.method = "PUT";
  request.url = ticket.url;
  request.headers = ticket.headers;
  request.body = bytes;
  request.is_cancelled = &is_aborted_;
  absl::Status last;
  absl::Duration wait = kDirectUploadBackoff;
  for (int attempt = 0; attempt < kDirectUploadAttemptsMax && !is_aborted_; ++attempt) {
    if (attempt > 0) absl::SleepFor(std::exchange(wait, wait * 2));
    const absl::StatusOr<HttpResponse> response = http_.Send(request, nullptr);
    if (response.ok() && IsStored(response->status)) return absl::OkStatus();
    last = !response.ok() ? response.status()
                          : absl::UnavailableError(absl::StrCat(
                                "the object store answers a PUT with ", response->status, ": ",
                                Printable(response->body.substr(0, kAnswerShownMax))));
    const bool passes = !response.ok() || response->status >= 500 || response->status == 429;
    if (!passes) break;
  }
  return last.ok() ? absl::CancelledError("the worker is stopping") : last;
}

void DirectUpload::Pause(const std::string& why) {
  if (is_aborted_) return;
  LogWarning(absl::StrCat("storing results directly failed: ", why, "; for ",
                          absl::FormatDuration(kDirectUploadPause), " they go to the coordinator"));
  const MutexLock lock(&mutex_);
  pause_end_ = SteadyTime::Now() + kDirectUploadPause;
}

bool DirectUpload::IsPaused() {
  const MutexLock lock(&mutex_);
  return SteadyTime::Now() < pause_end_;
}

}  // namespace sheaf::worker
