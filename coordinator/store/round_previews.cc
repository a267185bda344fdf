// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/round_previews.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <system_error>
#include <tuple>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "common/base/file.h"
#include "common/film/exr/exr_codec.h"
#include "common/film/shrink_image.h"

namespace sheaf::coordinator {
namespace {

namespace fs = std::filesystem;

// The channels from which the layers of the web page are computed.
const std::vector<std::string>& Channels() {
  static const std::vector<std::string> channels = {"R",        "G",        "B",      "stderr.R",
                                                    "stderr.G", "stderr.B", "samples"};
  return channels;
}

}  // namespace

absl::StatusOr<std::unique_ptr<RoundPreviews>> RoundPreviews::Open(
    const std::string& directory, const RoundPreviewLimits& limits) {
  if (absl::Status status = MakeDirectories(directory); !status.ok()) return status;
  std::unique_ptr<RoundPreviews> previews(new RoundPreviews(directory, limits));
  previews->Scan();
  return previews;
}

void RoundPreviews::Scan() {
  std::vector<std::tuple<fs::file_time_type, Name, uint64_t>> found;
  std::error_code error;
  for (fs::recursive_directory_iterator it(directory_, error), end; !error && it != end;
       it.increment(error)) {
    const fs::path& path = it->path();
    Name name;
    std::error_code ignored;
    const bool is_ours =
        path.extension() == ".exr" && absl::SimpleAtoi(path.stem().string(), &name.second) &&
        absl::SimpleAtoi(path.parent_path().filename().string(), &name.first.frame_number) &&
        absl::SimpleAtoi(path.parent_path().parent_path().filename().string(), &name.first.job_id);
    if (is_ours) found.emplace_back(it->last_write_time(ignored), name, it->file_size(ignored));
  }
  std::sort(found.begin(), found.end());
  const MutexLock lock(&mutex_);
  for (const auto& [time, name, size_bytes] : found) Add(name, size_bytes);
}

std::string RoundPreviews::FolderOf(const FrameId& frame) const {
  return absl::StrCat(directory_, "/", frame.job_id, "/", frame.frame_number);
}

std::string RoundPreviews::PathOf(const Name& name) const {
  return absl::StrCat(FolderOf(name.first), "/", name.second, ".exr");
}

absl::Status RoundPreviews::Keep(const FrameId& frame, int32_t round, const FrameImage& image) {
  if (limits_.bytes_max == 0) return absl::OkStatus();
  const absl::StatusOr<FrameImage> small = ShrinkImage(image, Channels(), limits_.pixels_max);
  if (!small.ok()) return small.status();
  const std::string bytes = EncodeFrameImage(*small);
  const MutexLock lock(&mutex_);
  if (absl::Status status = MakeDirectories(FolderOf(frame)); !status.ok()) return status;
  const Name name{frame, round};
  if (absl::Status status = WriteSecretAtomically(PathOf(name), bytes); !status.ok()) return status;
  Add(name, bytes.size());
  ThinOut(frame);
  return absl::OkStatus();
}

void RoundPreviews::Add(const Name& name, uint64_t size_bytes) {
  Entry& entry = entries_[name];
  by_version_.erase(entry.version);
  size_bytes_ += size_bytes - entry.size_bytes;
  entry = {++last_version_, size_bytes};
  by_version_[entry.version] = name;
  while (size_bytes_ > limits_.bytes_max) Remove(by_version_.begin()->second);
}

void RoundPreviews::Remove(const Name& name) {
  const auto entry = entries_.find(name);
  std::error_code ignored;  // A file that cannot be removed is found again at the next start.
  fs::remove(PathOf(name), ignored);
  fs::remove(FolderOf(name.first), ignored);  // Succeeds if it is empty.
  size_bytes_ -= entry->second.size_bytes;
  by_version_.erase(entry->second.version);
  entries_.erase(entry);
}

std::set<int32_t> RoundPreviews::RoundsOf(const FrameId& frame) const {
  std::set<int32_t> rounds;
  for (auto it = entries_.lower_bound({frame, std::numeric_limits<int32_t>::min()});
       it != entries_.end() && it->first.first == frame; ++it) {
    rounds.insert(it->first.second);
  }
  return rounds;
}

// Removes every other preview except the first and the last.
void RoundPreviews::ThinOut(const FrameId& frame) {
  const std::set<int32_t> rounds = RoundsOf(frame);
  if (rounds.size() <= limits_.rounds_max) return;
  size_t place = 0;
  for (const int32_t round : rounds) {
    if (place++ % 2 == 1 && place < rounds.size()) Remove({frame, round});
  }
}

uint64_t RoundPreviews::VersionOf(const FrameId& frame, int32_t round) const {
  const MutexLock lock(&mutex_);
  const auto entry = entries_.find({frame, round});
  return entry == entries_.end() ? 0 : entry->second.version;
}

absl::StatusOr<FrameImage> RoundPreviews::Read(const FrameId& frame, int32_t round) const {
  if (VersionOf(frame, round) == 0) {
    return absl::NotFoundError(absl::StrCat("jobs/", frame.job_id, "/frames/", frame.frame_number,
                                            ": no image of round ", round, " is kept"));
  }
  return ReadFrameImage(PathOf({frame, round}));
}

void RoundPreviews::RemoveFrom(const FrameId& frame, int32_t round) {
  const MutexLock lock(&mutex_);
  for (const int32_t kept : RoundsOf(frame)) {
    if (kept >= round) Remove({frame, kept});
  }
}

std::map<uint64_t, uint64_t> RoundPreviews::BytesByJob() const {
  const MutexLock lock(&mutex_);
  std::map<uint64_t, uint64_t> bytes;
  for (const auto& [name, entry] : entries_) bytes[name.first.job_id] += entry.size_bytes;
  return bytes;
}

void RoundPreviews::RemoveJob(uint64_t job_id) {
  const MutexLock lock(&mutex_);
  while (true) {
    const auto first = entries_.lower_bound(
        {{job_id, std::numeric_limits<int32_t>::min()}, std::numeric_limits<int32_t>::min()});
    if (first == entries_.end() || first->first.first.job_id != job_id) break;
    Remove(Name(first->first));
  }
  std::error_code ignored;
  fs::remove(absl::StrCat(directory_, "/", job_id), ignored);  // Succeeds if it is empty.
}

}  // namespace sheaf::coordinator
