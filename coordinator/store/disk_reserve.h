// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// DiskReserve: disk space that only the database may take, so that a coordinator whose disk is full
// starts, and does what people ask of it to free space.
//
//     DIR/reserve   a file that occupies the space while it is not needed
//
// Where the file system is full, half of the file is given up at a time; the coordinator's other
// writers ask CheckRoom, and so leave to the database what was given up. Programs of others may
// take it: then the next half is left. The file is made whole again when there is room
// ([ADR 116](docs/adr/0116-space-is-asked-for.md)).
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "common/base/mutex.h"

namespace sheaf::coordinator {

inline constexpr uint64_t kDiskReserveDefault = uint64_t{64} << 20;
// A small file system does not become a reserve.
inline constexpr uint64_t kReserveFractionMax = 8;  // 1 / 8.
// What the database may need at a start and between two looks.
inline constexpr uint64_t kDatabaseBytesMin = uint64_t{1} << 20;

// Where the file system lacks space for the database: removes the uploads of an earlier life, then
// gives up half of its reserve. Requires: the caller holds the directory's lock, so that no other
// process writes uploads.
void MakeRoomForDatabase(const std::string& directory);

// Thread safety: all members may be called concurrently.
class DiskReserve {
 public:
  // bytes_max: 0: none is kept, and what an earlier life has kept is given up.
  DiskReserve(const std::string& directory, uint64_t bytes_max);

  // Gives up some of it where the file system is full, and restores it where there is room. For
  // each look at the disk.
  void Update();
  // Bytes of the free space that are the database's.
  uint64_t OwedBytes() const;
  // Whether this many bytes beside the database's may be written. Errors: kResourceExhausted.
  absl::Status CheckRoom(uint64_t bytes) const;

 private:
  uint64_t WantedBytes() const;

  const std::string directory_, path_;
  const uint64_t bytes_max_;
  Mutex mutex_;  // Held while the file changes.
};

}  // namespace sheaf::coordinator
