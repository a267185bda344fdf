// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/disk_reserve.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "common/base/memory_room.h"
#include "common/base/surroundings/disk_space.h"

namespace sheaf::coordinator {
namespace {

namespace fs = std::filesystem;

std::string PathIn(const std::string& directory) { return absl::StrCat(directory, "/reserve"); }

uint64_t SizeOf(const std::string& path) {
  std::error_code error;
  const uintmax_t size = fs::file_size(path, error);
  return error ? 0 : size;
}

bool LacksSpace(const std::string& directory) {
  const std::optional<DiskSpace> space = DiskSpaceOf(directory);
  return space && space->available_bytes < kDatabaseBytesMin;
}

// Releases half of the file. Returns the bytes released.
uint64_t GiveHalf(const std::string& path) {
  const uint64_t size = SizeOf(path);
  if (size == 0) return 0;
  const uint64_t left = size / 2 < kDatabaseBytesMin / 2 ? 0 : size / 2;
  std::error_code error;
  if (left == 0) {
    fs::remove(path, error);
  } else {
    fs::resize_file(path, left, error);
  }
  return error ? 0 : size - left;
}

// Removes uploads, which no client was told about.
uint64_t RemoveUploads(const std::string& directory) {
  uint64_t bytes = 0;
  std::error_code error;
  for (fs::directory_iterator it(directory + "/content/partial", error), end; !error && it != end;
       it.increment(error)) {
    std::error_code ignored;
    const uintmax_t size = it->file_size(ignored);
    if (!ignored && fs::remove(it->path(), ignored)) bytes += size;
  }
  return bytes;
}

}  // namespace

void MakeRoomForDatabase(const std::string& directory) {
  if (!LacksSpace(directory)) return;
  if (const uint64_t bytes = RemoveUploads(directory); bytes > 0) {
    LogWarning(absl::StrCat(directory, ": its file system is full; removed incomplete uploads, ",
                            FormatMemory(bytes)));
  }
  if (!LacksSpace(directory)) return;
  if (const uint64_t bytes = GiveHalf(PathIn(directory)); bytes > 0) {
    LogWarning(absl::StrCat(directory, ": its file system is full; the database gets ",
                            FormatMemory(bytes), " of its reserve (--disk-reserve)"));
  }
}

DiskReserve::DiskReserve(const std::string& directory, uint64_t bytes_max)
    : directory_(directory), path_(PathIn(directory)), bytes_max_(bytes_max) {
  std::error_code ignored;
  if (bytes_max_ == 0) fs::remove(path_, ignored);
  Update();
}

uint64_t DiskReserve::WantedBytes() const {
  const std::optional<DiskSpace> space = DiskSpaceOf(directory_);
  return space ? AtMostFractionOf(*space, kReserveFractionMax, bytes_max_) : 0;
}

uint64_t DiskReserve::OwedBytes() const {
  const uint64_t wanted = WantedBytes();
  return wanted - std::min(wanted, SizeOf(path_));
}

void DiskReserve::Update() {
  if (bytes_max_ == 0) return;
  const std::optional<DiskSpace> space = DiskSpaceOf(directory_);
  if (!space) return;
  const MutexLock lock(&mutex_);
  if (space->available_bytes < kDatabaseBytesMin) {
    const uint64_t bytes = GiveHalf(path_);
    if (bytes == 0) return;
    LogWarning(absl::StrCat(directory_, ": its file system is full; the database gets ",
                            FormatMemory(bytes), " of its reserve (--disk-reserve)"));
    return;
  }
  const uint64_t wanted = WantedBytes(), owed = OwedBytes();
  // Twice the threshold of release, as hysteresis.
  if (owed == 0 || space->available_bytes < owed + 2 * kDatabaseBytesMin) return;
  const int file = ::open(path_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
  if (file < 0) return;  // The next update retries.
  const int error = ::posix_fallocate(file, 0, static_cast<off_t>(wanted));
  ::close(file);
  if (error == 0) return;
  std::error_code ignored;
  fs::remove(path_, ignored);
  LogWarning(
      absl::StrCat(path_, ": the database's reserve cannot be made: ", std::strerror(error)));
}

absl::Status DiskReserve::CheckRoom(uint64_t bytes) const {
  if (bytes_max_ == 0) return absl::OkStatus();  // A write will tell.
  const std::optional<DiskSpace> space = DiskSpaceOf(directory_);
  const uint64_t owed = OwedBytes();
  if (!space || owed == 0 || space->available_bytes >= owed + bytes) return absl::OkStatus();
  return absl::ResourceExhaustedError(absl::StrCat(
      directory_, ": ", std::strerror(ENOSPC), ": ", FormatMemory(space->available_bytes),
      " are left, which the database keeps ", "(--disk-reserve); free space on its file system"));
}

}  // namespace sheaf::coordinator
