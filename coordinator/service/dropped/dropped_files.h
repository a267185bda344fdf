// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// DroppedFiles: the files of one submission in a folder, as they come from a browser piece by
// piece.
//
//     FOLDER/files/NAME   the dropped files; names are checked, and there are no links
//     FOLDER/scratch      for the process that reads the scene
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/content/file_descriptor.h"

namespace sheaf::coordinator {

struct DroppedLimits {
  uint64_t bytes_max = uint64_t{4} << 30;  // All files together.
  uint64_t files_max = 20'000;
};

// Claims disk space for the bytes, calls write, and gives the claim up. Errors: kResourceExhausted
// where the space is lacking; those of write.
using WriteWithSpace =
    std::function<absl::Status(uint64_t bytes, const std::function<absl::Status()>& write)>;

// Thread safety: one thread at a time.
class DroppedFiles {
 public:
  // Makes the folder, which must not be there. Errors: those of files.
  static absl::StatusOr<std::unique_ptr<DroppedFiles>> Create(const std::string& folder,
                                                              const DroppedLimits& limits,
                                                              WriteWithSpace write_with_space);
  // Removes the folder with all that is in it.
  ~DroppedFiles();
  DroppedFiles(const DroppedFiles&) = delete;
  DroppedFiles& operator=(const DroppedFiles&) = delete;

  // As SubmissionDesk::Append.
  absl::StatusOr<uint64_t> Append(const std::string& name, uint64_t offset_bytes,
                                  std::string_view bytes);
  // Removes the files that the process has written to its folder.
  absl::Status ClearScratch();

  const std::string& folder() const { return folder_; }
  uint64_t bytes() const { return bytes_; }
  uint64_t file_count() const { return sizes_.size(); }

 private:
  DroppedFiles(std::string folder, FileDescriptor files, const DroppedLimits& limits,
               WriteWithSpace write_with_space)
      : folder_(std::move(folder)),
        files_(std::move(files)),
        limits_(limits),
        write_with_space_(std::move(write_with_space)) {}
  absl::Status CheckLimits(const std::string& name, uint64_t more) const;
  absl::Status Write(const std::string& name, std::string_view bytes, bool is_new) const;

  const std::string folder_;
  const FileDescriptor files_;  // The folder "files".
  const DroppedLimits limits_;
  const WriteWithSpace write_with_space_;
  std::map<std::string, uint64_t> sizes_;  // Sizes by file name; at most files_max.
  uint64_t bytes_ = 0;
};

// Opens a regular file below the folder for reading; a name that leads out of it or over a symbolic
// link is refused. Errors: kInvalidArgument, saying so; those of files.
absl::StatusOr<FileDescriptor> OpenBeneath(const std::string& folder, const std::string& name);

}  // namespace sheaf::coordinator
