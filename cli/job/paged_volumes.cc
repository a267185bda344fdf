// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/paged_volumes.h"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <system_error>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "common/base/file.h"
#include "common/base/surroundings/home_directory.h"
#include "common/volume/volume_file.h"

namespace sheaf::cli {
namespace {

namespace fs = std::filesystem;

// The files of media that have no other use, and whose velocities nothing reads.
std::set<std::string> PageableFiles(const SceneDescription& scene) {
  std::set<std::string> files, others;
  for (const MediumDescription& medium : scene.media) {
    const auto* volume = std::get_if<VolumeFileMedium>(&medium.kind);
    if (volume == nullptr) continue;
    (medium.Moves() ? others : files).insert(volume->file);
  }
  // Surfaces are made of the file itself.
  for (const TriangleMesh& mesh : scene.meshes) others.insert(mesh.file);
  std::erase_if(files, [&](const std::string& file) { return others.contains(file); });
  return files;
}

uint64_t SizeOf(const std::string& path) {
  std::error_code error;
  const uintmax_t bytes = fs::file_size(path, error);
  return error ? 0 : bytes;
}

// The parts in a folder, as SplitPageFile has written them.
std::optional<PageParts> PartsIn(const std::string& folder) {
  PageParts parts{folder + "/index", {}};
  const std::optional<size_t> count = PagePartCount(parts.index_path);
  if (!count) return std::nullopt;
  for (size_t i = 0; i < *count; ++i) parts.part_paths.push_back(PagePartPath(folder, i));
  return parts;
}

class TemporaryFolder {
 public:
  explicit TemporaryFolder(std::string path) : path_(std::move(path)) {}
  ~TemporaryFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

 private:
  const std::string path_;
};

}  // namespace

std::string PagedVolumes::DefaultFolder() {
  if (const char* cache = std::getenv("XDG_CACHE_HOME"); cache != nullptr && cache[0] == '/') {
    return absl::StrCat(cache, "/sheaf-pages");
  }
  const std::string home = HomeDirectory();
  return home.empty() ? "" : absl::StrCat(home, "/.cache/sheaf-pages");
}

absl::StatusOr<std::set<std::string>> PagedVolumes::Replace(const SceneDescription& scene,
                                                            OpenedFiles* files,
                                                            std::vector<std::string>* notes) {
  std::set<std::string> on_demand;
  for (const std::string& name : PageableFiles(scene)) {
    const absl::StatusOr<std::string> path = files->LocalPath(name);
    if (!path.ok()) return path.status();
    if (const std::optional<size_t> count = PagePartCount(*path)) {
      // The scene comes from a farm: its parts are beside it.
      for (size_t i = 0; i < *count; ++i) {
        const std::string part = PagePartName(name, i);
        if (absl::Status status = files->LocalPath(part).status(); !status.ok()) return status;
        on_demand.insert(part);
      }
      continue;
    }
    if (folder_.empty() || SizeOf(*path) < bytes_min_) continue;
    absl::StatusOr<std::optional<PageParts>> made = PartsOf(name, *path, notes);
    if (!made.ok()) return made.status();
    if (!*made) continue;
    files->Replace(name, (*made)->index_path);
    for (size_t i = 0; i < (*made)->part_paths.size(); ++i) {
      const std::string part = PagePartName(name, i);
      files->Replace(part, (*made)->part_paths[i]);
      on_demand.insert(part);
    }
  }
  return on_demand;
}

absl::StatusOr<std::optional<PageParts>> PagedVolumes::PartsOf(const std::string& name,
                                                               const std::string& path,
                                                               std::vector<std::string>* notes) {
  const absl::StatusOr<BlobDigest> digest = digests_.Of(path);
  if (!digest.ok()) return digest.status();
  const std::string folder = absl::StrCat(folder_, "/", digest->sha256_hex);
  const MutexLock lock(&mutex_);
  used_.insert(folder);
  std::error_code ignored;
  fs::last_write_time(folder, fs::file_time_type::clock::now(), ignored);
  if (std::optional<PageParts> kept = PartsIn(folder)) return kept;
  const absl::StatusOr<PageParts> made = Make(name, path, folder);
  if (!made.ok()) {
    notes->push_back(absl::StrCat(
        "note: ", name, ": is submitted whole, as it has no page file: ", made.status().message()));
    return std::optional<PageParts>();
  }
  RemoveOld();
  return std::optional<PageParts>(*made);
}

absl::StatusOr<PageParts> PagedVolumes::Make(const std::string& name, const std::string& path,
                                             const std::string& folder) const {
  const std::string making = absl::StrCat(folder, ".part-", ::getpid());
  if (absl::Status status = MakeDirectories(making); !status.ok()) return status;
  const TemporaryFolder remover(making);
  const std::string page_path = PageIndexBytes(path) ? path : making + "/pages";
  if (page_path != path) {
    const absl::StatusOr<PageFileSummary> packed = MakePageFile(name, path, page_path);
    if (!packed.ok()) return packed.status();
    if (!packed->left_out.empty()) {
      return absl::FailedPreconditionError("some of its grids are not numbers");
    }
  }
  const absl::StatusOr<PageParts> parts = SplitPageFile(name, page_path, making);
  if (!parts.ok()) return parts.status();
  if (page_path != path) ::unlink(page_path.c_str());
  std::error_code error;
  fs::rename(making, folder, error);
  // Another command may have been faster.
  if (std::optional<PageParts> kept = PartsIn(folder)) return *kept;
  return absl::UnavailableError(absl::StrCat("writing ", folder, ": ", error.message()));
}

void PagedVolumes::RemoveOld() const {
  struct Kept {
    fs::file_time_type used;
    std::string path;
    uint64_t bytes = 0;
  };
  std::vector<Kept> all;
  uint64_t bytes = 0;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_, error)) {
    Kept kept{entry.last_write_time(error), entry.path().string()};
    for (const fs::directory_entry& file : fs::directory_iterator(entry.path(), error)) {
      kept.bytes += SizeOf(file.path().string());
    }
    if (used_.contains(kept.path)) continue;
    bytes += kept.bytes;
    all.push_back(std::move(kept));
  }
  std::sort(all.begin(), all.end(), [](const Kept& a, const Kept& b) { return a.used < b.used; });
  for (const Kept& kept : all) {
    if (bytes <= kKeptPagesBytesMax) return;
    fs::remove_all(kept.path, error);
    bytes -= kept.bytes;
  }
}

}  // namespace sheaf::cli
