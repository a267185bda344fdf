// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PagedVolumes: replaces large files of volumes, before they are submitted, by page files in parts,
// of which workers fetch what their tasks read. Page files are kept in a folder from one command to
// the next. The images have the same bits.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "cli/job/identity/file_digests.h"
#include "cli/job/identity/opened_files.h"
#include "common/base/mutex.h"
#include "common/scene/scene_description.h"
#include "common/volume/page_maker.h"

namespace sheaf::cli {

// Smaller files are submitted as they are.
inline constexpr uint64_t kPagedFileBytesMin = uint64_t{256} << 20;
// All page files that are kept, beside those of the running command, take at most this; the oldest
// are removed.
inline constexpr uint64_t kKeptPagesBytesMax = uint64_t{64} << 30;

// Thread safety: Replace may be called concurrently; each file is packed once.
class PagedVolumes {
 public:
  // bytes_min: of the files that are replaced. folder: where page files are kept; empty: no file is
  // replaced. digests must outlive the object.
  PagedVolumes(uint64_t bytes_min, std::string folder, FileDigests* digests)
      : bytes_min_(bytes_min), folder_(std::move(folder)), digests_(*digests) {}

  // "$XDG_CACHE_HOME/sheaf-pages" or "~/.cache/sheaf-pages"; empty without a home.
  static std::string DefaultFolder();

  // Replaces the files that media read, and nothing else of the scene. Returns the names of their
  // parts. A line for each file that stays as it is, though it is large, is added to *notes.
  // Errors: those of hashing a file.
  absl::StatusOr<std::set<std::string>> Replace(const SceneDescription& scene, OpenedFiles* files,
                                                std::vector<std::string>* notes);

 private:
  // The parts of the volume at this path; none if it cannot be paged: *notes says why.
  absl::StatusOr<std::optional<PageParts>> PartsOf(const std::string& name, const std::string& path,
                                                   std::vector<std::string>* notes);
  absl::StatusOr<PageParts> Make(const std::string& name, const std::string& path,
                                 const std::string& folder) const;
  // Removes the oldest folders beyond kKeptPagesBytesMax, except those of this command.
  void RemoveOld() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const uint64_t bytes_min_;
  const std::string folder_;
  FileDigests& digests_;
  Mutex mutex_;
  std::set<std::string> used_ ABSL_GUARDED_BY(mutex_);  // Folders of this command.
};

}  // namespace sheaf::cli
