// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/upkeep/share_control.h"

#include <map>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"

namespace sheaf::coordinator {

absl::Status ShareControl::Load() {
  const absl::StatusOr<std::map<ShareSubject, ShareSetting>> shares = store_.LoadShares();
  if (!shares.ok()) return shares.status();
  const MutexLock lock(&tables_.mutex);
  for (const auto& [subject, setting] : *shares) tables_.scheduler.SetShare(subject, setting);
  return absl::OkStatus();
}

absl::StatusOr<ShareView> ShareControl::Set(const ShareSubject& subject,
                                            const std::function<void(ShareSetting*)>& change) {
  const MutexLock setting_one(&set_mutex_);
  ShareSetting setting;
  {
    const MutexLock lock(&tables_.mutex);
    const std::map<ShareSubject, ShareSetting>& all = tables_.scheduler.share_settings();
    const auto found = all.find(subject);
    if (found == all.end() && all.size() >= limits_.share_settings_max) {
      return absl::ResourceExhaustedError(
          absl::StrCat("there are ", all.size(), " settings of shares, the limit; remove some ",
                       "with sheaf share reset"));
    }
    if (found != all.end()) setting = found->second;
  }
  change(&setting);
  if (absl::Status status = CheckShareSetting(subject, setting); !status.ok()) return status;
  absl::Status written = store_.WriteShare(subject, setting);
  disk_.Note(written);
  if (!written.ok()) return written;
  LogInfo(absl::StrCat(FormatShareSubject(subject), ": weight ", setting.weight, ", at most ",
                       setting.threads_max, " threads (0: no limit)"));
  signals_.Changed();
  const MutexLock lock(&tables_.mutex);
  tables_.scheduler.SetShare(subject, setting);
  return ViewOf(subject);
}

absl::Status ShareControl::Reset(const ShareSubject& subject) {
  const MutexLock setting_one(&set_mutex_);
  absl::Status removed = store_.RemoveShare(subject);
  disk_.Note(removed);
  if (!removed.ok()) return removed;
  LogInfo(absl::StrCat(FormatShareSubject(subject), ": its setting is removed"));
  signals_.Changed();
  const MutexLock lock(&tables_.mutex);
  tables_.scheduler.ResetShare(subject);
  return absl::OkStatus();
}

ShareView ShareControl::ViewOf(const ShareSubject& subject) const {
  ShareView view;
  view.subject = FormatShareSubject(subject);
  const std::map<ShareSubject, ShareSetting>& all = tables_.scheduler.share_settings();
  const auto found = all.find(subject);
  view.is_set = found != all.end();
  if (view.is_set) view.setting = found->second;
  view.threads_held = tables_.scheduler.held_threads().Of(subject);
  return view;
}

std::vector<ShareView> ShareControl::List() const {
  const MutexLock lock(&tables_.mutex);
  std::map<ShareSubject, int32_t> job_counts;
  for (const auto& [subject, setting] : tables_.scheduler.share_settings()) job_counts[subject];
  for (const auto& [id, job] : tables_.scheduler.jobs()) {
    if (job.phase != JobPhase::kLive) continue;
    ++job_counts[{ShareKind::kUser, job.spec.owner}];
    ++job_counts[{ShareKind::kShow, job.spec.show}];
    ++job_counts[{ShareKind::kPool, job.spec.requirements.pool}];
  }
  std::vector<ShareView> views;
  for (const auto& [subject, job_count] : job_counts) {
    views.push_back(ViewOf(subject));
    views.back().job_count = job_count;
  }
  return views;
}

}  // namespace sheaf::coordinator
