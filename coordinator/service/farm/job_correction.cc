// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of JobLifecycle that removes the results of those who made false ones. The frames that
// hold such results are rendered again from the parts that are left, also where they are delivered
// already. A frame that is rendered in rounds begins with its first round, for its decisions came
// from false sums.
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/base/log.h"
#include "coordinator/service/farm/job_lifecycle.h"

namespace sheaf::coordinator {
namespace {

// The frames that people are told of by number.
constexpr size_t kFramesToldMax = 20;

std::string FramesText(const std::set<int32_t>& numbers) {
  std::vector<int32_t> told(numbers.begin(), numbers.end());
  const bool all = told.size() <= kFramesToldMax;
  if (!all) told.resize(kFramesToldMax);
  return absl::StrCat(numbers.size() == 1 ? "frame " : "frames ", absl::StrJoin(told, ", "),
                      all ? "" : " and more");
}

}  // namespace

absl::Status JobLifecycle::RemoveResultsOf(const std::string& identity) {
  const MutexLock settling(&settle_mutex_);
  const PartKeys left = removals_.Left();
  absl::StatusOr<std::vector<PartRow>> rows = store_.FindPartsOf(identity);
  if (!rows.ok()) return rows.status();
  std::map<uint64_t, std::vector<PartRow>> by_job;
  for (PartRow& row : *rows) {
    if (left.contains(row.key)) continue;  // A call before this one corrected its frame.
    by_job[row.key.frame.job_id].push_back(std::move(row));
  }
  for (const auto& [job_id, parts] : by_job) {
    absl::Status corrected = CorrectJob(job_id, identity, parts);
    if (!corrected.ok()) return corrected;
    LogWarning(absl::StrCat("job ", job_id, ": ", parts.size(), " results of ", identity,
                            " are not believed any more and are rendered again"));
  }
  rows = store_.FindPartsOf(identity);
  if (!rows.ok()) return rows.status();
  if (rows->empty()) return absl::OkStatus();
  return absl::UnavailableError(
      absl::StrCat("the disk does not remove ", rows->size(), " of them yet; it is asked again"));
}

absl::Status JobLifecycle::CorrectJob(uint64_t job_id, const std::string& identity,
                                      const std::vector<PartRow>& false_parts) {
  std::set<int32_t> numbers, delivered;
  for (const PartRow& part : false_parts) numbers.insert(part.key.frame.frame_number);
  StoredJob job;
  bool goes_on = false;
  {
    const MutexLock lock(&tables_.mutex);
    const absl::StatusOr<const JobRecord*> found = tables_.FindJob(job_id);
    if (found.ok()) {
      const JobRecord& record = **found;
      goes_on = record.phase == JobPhase::kLive ||
                (record.phase == JobPhase::kSucceeded && !record.spec.pilot);
      job = StoredJobOf(record);
      for (const FrameRecord& frame : record.frames) {
        const bool is_delivered = frame.phase == FrameRecord::Phase::kDelivered;
        if (is_delivered && numbers.contains(frame.number())) delivered.insert(frame.number());
      }
    }
  }
  if (!delivered.empty()) {
    absl::Status warned =
        SetWarning(job_id, absl::StrCat(FramesText(delivered),
                                        goes_on ? " corrected: " : " may be false: ", "results of ",
                                        identity, " were found false after delivery",
                                        goes_on ? "" : ", and the job does not go on"));
    if (!warned.ok()) return warned;
  }
  if (!goes_on) {
    RemoveFalse(false_parts);
    return absl::OkStatus();
  }
  std::vector<JobStore::ReopenedFrame> reopened;
  for (const FrameSpec& frame : job.spec.frames) {
    if (!numbers.contains(frame.frame_number)) continue;
    reopened.push_back({frame, /*rounds=*/{}, delivered.contains(frame.frame_number)});
  }
  return ReopenFrames(std::move(job), reopened, false_parts);
}

void JobLifecycle::RemoveFalse(const std::vector<PartRow>& parts) {
  removals_.Remove(parts);
  const MutexLock lock(&tables_.mutex);
  tables_.scheduler.counters().parts_revoked += parts.size();
}

absl::Status JobLifecycle::SetWarning(uint64_t job_id, const std::string& text) {
  LogWarning(absl::StrCat("job ", job_id, ": ", text));
  absl::Status written = store_.SetWarning(job_id, text);
  disk_.Note(written);
  const MutexLock lock(&tables_.mutex);
  tables_.accounts[job_id].warning = text;
  return written;
}

}  // namespace sheaf::coordinator
