// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Submissions: all scenes that people have dropped on the page, from the first file to the job. A
// restart of the coordinator forgets them; jobs that were made stay.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/base/mutex.h"
#include "common/base/steady_time.h"
#include "coordinator/service/dropped/dropped_files.h"
#include "coordinator/service/dropped/scene_reader_process.h"
#include "coordinator/service/view/submission_desk.h"
#include "sheaf/v1/submission.pb.h"

namespace sheaf::coordinator {

// Submissions kept, in total and per user. A further one replaces the oldest that has ended, or is
// refused.
inline constexpr size_t kSubmissionsMax = 64;
inline constexpr size_t kSubmissionsOfOwnerMax = 8;
// Scenes that are read at once; others wait in their order.
inline constexpr size_t kSceneReadersMax = 2;
// A submission without requests for this long ends.
inline constexpr absl::Duration kSubmissionSilenceMax = absl::Minutes(15);
// Limits a piece of a file.
inline constexpr uint64_t kPieceBytesMax = uint64_t{2} << 20;
// Limits the messages of one submission; longer ones are cut.
inline constexpr size_t kSubmissionTextBytesMax = 64 << 10;

struct SubmissionOptions {
  std::string folder;   // Holds all submissions; emptied at the start.
  std::string program;  // `sheaf`; empty: scenes are not read.
  std::string why_not;  // Why nothing is taken; empty: it is.
  DroppedLimits limits;
  WriteWithSpace write_with_space;
  ReaderProcessLimits reader;
};

// Makes a job of what a process has prepared in the folder, and returns its id. The reply and the
// files are untrusted.
using JobMaker = std::function<absl::StatusOr<std::string>(
    const SubmissionCaller& caller, const std::string& folder, const v1::PrepareReply& reply)>;

class Submissions final : public SubmissionDesk {
 public:
  // Errors: those of emptying the folder.
  static absl::StatusOr<std::unique_ptr<Submissions>> Start(SubmissionOptions options,
                                                            JobMaker make_job);
  // Ends processes that read, and removes all files.
  ~Submissions() override;

  SubmissionOffer Offer() const override;
  absl::StatusOr<SubmissionView> Begin(const SubmissionCaller& caller) override;
  absl::StatusOr<uint64_t> Append(const SubmissionCaller& caller, const std::string& id,
                                  const std::string& name, uint64_t offset_bytes,
                                  std::string_view bytes) override;
  absl::StatusOr<SubmissionView> Read(const SubmissionCaller& caller, const std::string& id,
                                      const SubmissionWish& wish) override;
  absl::StatusOr<SubmissionView> Find(const SubmissionCaller& caller,
                                      const std::string& id) const override;
  absl::Status Discard(const SubmissionCaller& caller, const std::string& id) override;

 private:
  struct Submission {
    SubmissionCaller caller;
    SubmissionView view;
    SubmissionWish wish;
    std::unique_ptr<DroppedFiles> files;  // Null once it has ended.
    SteadyTime heard;
  };
  using Entries = std::map<uint64_t, std::shared_ptr<Submission>>;

  Submissions(SubmissionOptions options, JobMaker make_job)
      : options_(std::move(options)), make_job_(std::move(make_job)) {}
  absl::StatusOr<std::shared_ptr<Submission>> FindOf(const SubmissionCaller& caller,
                                                     const std::string& id) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Errors: kResourceExhausted.
  absl::Status MakeRoom(const std::string& owner) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void EndSilent(SteadyTime now) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Runs on each thread that reads until it is stopped.
  void ReadInTurn(const std::stop_token& stop);
  void ReadOne(Submission* submission, const std::stop_token& stop);
  // Reads with all protections that the system has. Errors: kFailedPrecondition where they do not
  // suffice; those of ReadDroppedScene.
  absl::StatusOr<v1::PrepareReply> ReadConfined(DroppedFiles* files, const SubmissionWish& wish,
                                                const std::stop_token& stop);
  void Finish(Submission* submission, const absl::Status& status);

  const SubmissionOptions options_;
  const JobMaker make_job_;
  mutable Mutex mutex_;
  CondVar changed_;
  Entries entries_ ABSL_GUARDED_BY(mutex_);  // By id.
  std::deque<std::shared_ptr<Submission>> waiting_ ABSL_GUARDED_BY(mutex_);
  uint64_t next_id_ ABSL_GUARDED_BY(mutex_) = 1;
  uint32_t protections_ ABSL_GUARDED_BY(mutex_);  // That the system has, as far as is known.
  std::vector<std::jthread> readers_;             // Last: they use all of the above.
};

}  // namespace sheaf::coordinator
