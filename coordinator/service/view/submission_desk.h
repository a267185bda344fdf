// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SubmissionDesk: receives the files of a scene piece by piece from users who drop them on the
// page, and makes a job of them. It hides where the files are stored and which process reads them.
//
//     Begin > Append ... > Read > (kChoosing > Read) > kSubmitted or kRefused
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace sheaf::coordinator {

enum class SubmissionState {
  kReceiving,  // It accepts files.
  kReading,    // A process reads the scene, or will when others have been read.
  kChoosing,   // The user must choose one of the scenes.
  kSubmitted,  // The job is made.
  kRefused,    // No job was made; the messages say why.
};
// "receiving", "reading", "choosing", "submitted" or "refused".
const char* SubmissionStateName(SubmissionState state);

struct SubmissionView {
  std::string id;
  SubmissionState state = SubmissionState::kReceiving;
  uint64_t file_count = 0;
  uint64_t received_bytes = 0;
  std::vector<std::string> scenes;  // To choose from, in kChoosing.
  // Lines for users: errors with file, line and column, or the notes of a job.
  std::string messages;
  std::string job_id;  // In kSubmitted.
};

// The scenes that the desk takes.
struct SubmissionOffer {
  std::string why_not;     // Why it takes nothing; empty: it does.
  uint64_t bytes_max = 0;  // Limit of a submission.
  uint64_t files_max = 0;
  uint64_t piece_bytes_max = 0;  // Limit of one Append.
};

// The user who submits.
struct SubmissionCaller {
  std::string owner;  // The job's: a user's name, or kLocalOwner without certificates.
  std::string who;    // For the audit log: "user:anna at 192.0.2.7".
};

// The job that the files are to become.
struct SubmissionWish {
  std::string scene;  // Among the files; empty: the only one.
  std::string title;  // Empty: the scene's name.
  uint64_t samples = 0;
  double target_error = 0;  // relMSE; 0 in both: as the scene says.
};

// Thread safety: all members may be called concurrently. None of them waits for a scene to be read.
// Errors of all: kNotFound for submissions of others, too.
class SubmissionDesk {
 public:
  virtual ~SubmissionDesk() = default;

  virtual SubmissionOffer Offer() const = 0;
  // Errors: kFailedPrecondition (it takes nothing); kResourceExhausted (a limit).
  virtual absl::StatusOr<SubmissionView> Begin(const SubmissionCaller& caller) = 0;
  // Adds bytes to the end of a file, and returns its size then. Bytes that are already there count
  // as a repetition. Errors: kInvalidArgument (the name); kOutOfRange (the offset is beyond the
  // end); kFailedPrecondition (not in kReceiving); kResourceExhausted (a limit, or the disk).
  virtual absl::StatusOr<uint64_t> Append(const SubmissionCaller& caller, const std::string& id,
                                          const std::string& name, uint64_t offset_bytes,
                                          std::string_view bytes) = 0;
  // Starts to read the scene. Errors: kFailedPrecondition (it is being read, or was read);
  // kInvalidArgument (there is no file); kResourceExhausted (too many wait).
  virtual absl::StatusOr<SubmissionView> Read(const SubmissionCaller& caller, const std::string& id,
                                              const SubmissionWish& wish) = 0;
  virtual absl::StatusOr<SubmissionView> Find(const SubmissionCaller& caller,
                                              const std::string& id) const = 0;
  // Removes a submission and its files; a job that was made stays. Errors: kFailedPrecondition (it
  // is being read).
  virtual absl::Status Discard(const SubmissionCaller& caller, const std::string& id) = 0;
};

}  // namespace sheaf::coordinator
