// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/output_files.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <climits>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <set>
#include <utility>

#include "absl/status/statusor.h"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/base/file.h"
#include "common/base/text/utf8.h"

namespace sheaf::cli {
namespace {

// Identifies a file, whatever its name.
using FileIdentity = std::pair<dev_t, ino_t>;

bool IdentityOf(const std::string& path, FileIdentity* identity) {
  struct stat info {};
  if (::stat(path.c_str(), &info) != 0) return false;
  *identity = {info.st_dev, info.st_ino};
  return true;
}

std::vector<std::string> FallbackFolders() {
  std::vector<std::string> folders;
  const char* const wanted[] = {std::getenv("TMPDIR"), "/tmp", std::getenv("HOME"), "."};
  for (const char* folder : wanted) {
    if (folder != nullptr && folder[0] != '\0') folders.emplace_back(folder);
  }
  return folders;
}

}  // namespace

bool IsPng(const std::string& path) { return absl::EndsWithIgnoreCase(path, ".png"); }

absl::Status CheckOutputName(const std::string& flag, const std::string& path,
                             const std::vector<std::string>& endings) {
  const auto fits = [&path](const std::string& e) { return absl::EndsWithIgnoreCase(path, e); };
  if (path.empty() || std::any_of(endings.begin(), endings.end(), fits)) return absl::OkStatus();
  if (path == "-") {
    return absl::InvalidArgumentError(
        absl::StrCat(flag, " -: nothing is written to standard output; name a file, as in ", flag,
                     " room", endings.front()));
  }
  return absl::InvalidArgumentError(
      absl::StrCat(flag, " ", path, ": Sheaf writes only ", absl::StrJoin(endings, " or "),
                   " here; change the ending and convert the file afterwards"));
}

absl::Status CheckOutputs(const std::vector<std::string>& outputs,
                          const std::vector<std::string>& inputs) {
  std::map<FileIdentity, std::string> known;
  FileIdentity identity;
  for (const std::string& input : inputs) {
    if (IdentityOf(input, &identity)) known.emplace(identity, input);
  }
  std::set<std::string> files, folders;
  for (const std::string& output : outputs) {
    if (output.empty()) continue;
    if (IdentityOf(output, &identity)) {
      const auto [found, is_new] = known.emplace(identity, output);
      if (!is_new) {
        return absl::InvalidArgumentError(
            absl::StrCat(output, ": would replace ", found->second,
                         ", which this command reads or writes too; write to another file"));
      }
    }
    const absl::StatusOr<std::string> file = FollowToFile(output);
    if (!file.ok()) return file.status();
    if (!files.insert(*file).second) {
      return absl::InvalidArgumentError(
          absl::StrCat(output, ": is named twice; write to another file"));
    }
    if (!folders.insert(std::filesystem::path(*file).parent_path().string()).second) continue;
    if (absl::Status status = CheckWritable(output); !status.ok()) return status;
  }
  return absl::OkStatus();
}

absl::Status WriteOrKeep(const std::string& path,
                         const std::function<absl::Status(const std::string& path)>& write) {
  const absl::Status status = write(path);
  if (status.ok()) return status;
  const std::string beginning = absl::StrCat("sheaf-", ::getpid(), "-");
  const std::filesystem::path file = std::filesystem::path(path).filename();
  const std::string ending = file.extension().string();
  const size_t stem_bytes_max =
      NAME_MAX - std::min<size_t>(beginning.size() + ending.size(), NAME_MAX);
  const std::string name =
      absl::StrCat(beginning, Utf8Prefix(file.stem().string(), stem_bytes_max), ending);
  const std::vector<std::string> folders = FallbackFolders();
  for (const std::string& folder : folders) {
    const std::string kept = absl::StrCat(folder, "/", name);
    if (!write(kept).ok()) continue;
    return absl::FailedPreconditionError(
        absl::StrCat(path, ": cannot be written (", status.message(), "); it is kept as ", kept));
  }
  return absl::FailedPreconditionError(absl::StrCat(path, ": cannot be written (", status.message(),
                                                    "), nor in ", absl::StrJoin(folders, ", ")));
}

}  // namespace sheaf::cli
