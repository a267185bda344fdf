// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/database/lost_commits.h"

#include <cstddef>
#include <string_view>

#include "absl/status/statusor.h"
#include "common/base/file.h"

namespace sheaf::coordinator {
namespace {

// The header of the log: magic number, version, page size, sequence number, two salts, two
// checksums; of four bytes each.
constexpr size_t kHeaderBytes = 32, kHeaderSummedBytes = 24, kPageSizeAt = 8, kSaltsAt = 16;
// The header of a frame: page number, pages of the database after a commit (otherwise 0), two
// salts, two checksums. A page follows.
constexpr size_t kFrameHeaderBytes = 24, kFrameSummedBytes = 8, kCommitAt = 4, kFrameSaltsAt = 8;
constexpr size_t kFrameSumsAt = 16;
constexpr size_t kSaltsBytes = 8;
// The lowest bit tells the byte order of the summed words; all else is big-endian.
constexpr uint32_t kMagic = 0x377f0682;
constexpr uint32_t kPageBytesMin = 512, kPageBytesMax = 65536;
// SQLite restarts its log after some megabytes.
constexpr uint64_t kLogBytesMax = uint64_t{1} << 30;
constexpr uint32_t kPageBytesUsual = 4096;  // SQLite's default, which all databases of Sheaf have.

uint32_t WordAt(std::string_view bytes, size_t at, bool big_endian = true) {
  uint32_t word = 0;
  for (size_t i = 0; i < 4; ++i) {
    const auto byte = static_cast<uint8_t>(bytes[at + i]);
    word |= uint32_t{byte} << 8 * (big_endian ? 3 - i : i);
  }
  return word;
}

// The running checksum of the log.
struct LogChecksum {
  bool big_endian = false;
  uint32_t first = 0, second = 0;

  void Add(std::string_view bytes) {
    for (size_t at = 0; at + 8 <= bytes.size(); at += 8) {
      first += WordAt(bytes, at, big_endian) + second;
      second += WordAt(bytes, at + 4, big_endian) + first;
    }
  }
  void AddFrame(std::string_view frame) {
    Add(frame.substr(0, kFrameSummedBytes));
    Add(frame.substr(kFrameHeaderBytes));
  }
  bool IsAt(std::string_view bytes, size_t at) const {
    return first == WordAt(bytes, at) && second == WordAt(bytes, at + 4);
  }
  // Whether the frame was written after frames of this sum.
  bool IsFollowedBy(std::string_view frame) const {
    LogChecksum sum = *this;
    sum.AddFrame(frame);
    return sum.IsAt(frame, kFrameSumsAt);
  }
};

bool IsCommit(std::string_view frame) { return WordAt(frame, kCommitAt) != 0; }

}  // namespace

int64_t CountLostCommits(const std::string& log_path) {
  const absl::StatusOr<std::string> log = ReadWholeFile(log_path, kLogBytesMax);
  if (!log.ok() || log->size() < kHeaderBytes) return 0;
  const std::string_view header = std::string_view(*log).substr(0, kHeaderBytes);
  LogChecksum sum{.big_endian = (WordAt(header, 0) & 1) != 0};
  sum.Add(header.substr(0, kHeaderSummedBytes));
  // Without its header SQLite drops all of the log.
  bool whole = (WordAt(header, 0) & ~1u) == kMagic && sum.IsAt(header, kHeaderSummedBytes);
  const uint32_t page_bytes = whole ? WordAt(header, kPageSizeAt) : kPageBytesUsual;
  if (page_bytes < kPageBytesMin || page_bytes > kPageBytesMax) return 0;
  std::string_view salts = whole ? header.substr(kSaltsAt, kSaltsBytes) : "";
  const size_t frame_bytes = kFrameHeaderBytes + page_bytes;
  int64_t commits = 0;
  bool is_acknowledged = false;  // One of the commits: a frame was written after it.
  size_t wrong_frames = 0;       // From the first wrong one on.
  std::string_view previous;     // The last of them.
  for (size_t at = kHeaderBytes; at + frame_bytes <= log->size(); at += frame_bytes) {
    const std::string_view frame = std::string_view(*log).substr(at, frame_bytes);
    if (salts.empty()) salts = frame.substr(kFrameSaltsAt, kSaltsBytes);
    // Frames of an earlier log, which this one overwrites from its start, have other salts.
    const bool is_of_log = frame.substr(kFrameSaltsAt, kSaltsBytes) == salts;
    if (wrong_frames == 0) {
      sum.AddFrame(frame);
      whole = whole && is_of_log && sum.IsAt(frame, kFrameSumsAt);
      if (whole) continue;
    } else if (is_of_log && IsCommit(previous)) {
      const LogChecksum stored{sum.big_endian, WordAt(previous, kFrameSumsAt),
                               WordAt(previous, kFrameSumsAt + 4)};
      // Only the sum of the first wrong frame may be wrong.
      is_acknowledged |=
          stored.IsFollowedBy(frame) || (wrong_frames == 1 && sum.IsFollowedBy(frame));
    }
    // The changed bits may be in the salts of the first wrong frame.
    if (IsCommit(frame) && (is_of_log || wrong_frames == 0)) ++commits;
    previous = frame;
    ++wrong_frames;
  }
  return is_acknowledged ? commits : 0;
}

}  // namespace sheaf::coordinator
