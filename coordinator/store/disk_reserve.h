// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// DiskReserve: disk space that only the database may use, so that a coordinator with a full disk
// starts, and can carry out requests that free space.
//
//     DIR/reserve   a file that occupies the space while it is not needed
//
// If the file system is full, half of the file is released at a time; the coordinator's other
// writers ask CheckRoom, and so leave the released space to the database. Other programs may take
// it; then the next half is left. The file is restored when there is room
// ([ADR 116](docs/adr/0116-space-is-asked-for.md)).
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "common/base/mutex.h"

namespace sheaf::coordinator {

inline constexpr uint64_t kDiskReserveDefault = uint64_t{64} << 20;
// Limits the reserve on a small file system.
inline constexpr uint64_t kReserveFractionMax = 8;  // 1 / 8.
// The space that the database may need at a start and between two updates.
inline constexpr uint64_t kDatabaseBytesMin = uint64_t{1} << 20;

// If the file system lacks space for the database: removes uploads from before the restart, then
// releases half of its reserve. Requires: the caller holds the directory's lock, so that no other
// process writes uploads.
void MakeRoomForDatabase(const std::string& directory);

// Thread safety: all members may be called concurrently.
class DiskReserve {
 public:
  // bytes_max: 0: no reserve; one from an earlier run is released.
  DiskReserve(const std::string& directory, uint64_t bytes_max);

  // Releases part of it if the file system is full, and restores it if there is room. Call it at
  // each check of the disk.
  void Update();
  // Bytes of the free space that belong to the database.
  uint64_t OwedBytes() const;
  // Checks that this many bytes may be written in addition to the database's. Errors:
  // kResourceExhausted.
  absl::Status CheckRoom(uint64_t bytes) const;

 private:
  uint64_t WantedBytes() const;

  const std::string directory_, path_;
  const uint64_t bytes_max_;
  Mutex mutex_;  // Held while the file changes.
};

}  // namespace sheaf::coordinator
