// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The C library's functions on files, for paths and descriptors of the simulated machine, by its
// SimDisk. As those, they return -1 or null with errno where they fail.
#pragma once

#include <dirent.h>
#include <sys/stat.h>
#include <sys/types.h>

#include <cerrno>
#include <cstdint>
#include <ctime>
#include <set>
#include <string>
#include <vector>

#include "tests/sim/machine.h"

namespace sheaf::sim {

// Whether a path or a descriptor is one of the simulated machine.
bool IsOurs(const char* path);
bool IsOurs(int descriptor);
bool IsOurs(DIR* folder);
// The same for a path that may be relative to an open folder.
bool IsOursAt(int folder, const char* path);
// The path of a name that may be relative to an open folder.
std::string PathAt(int folder, const char* path);

// 0 becomes 0, an errno becomes -1.
int Done(int error);
// Null for descriptors that are not open.
Machine::OpenFile* Opened(int descriptor);

int OpenOurs(const std::string& path, int flags);
ssize_t ReadOurs(int descriptor, void* buffer, size_t count, uint64_t offset);
ssize_t WriteOurs(int descriptor, const void* bytes, size_t count, uint64_t offset);
int SyncOurs(int descriptor);
int TruncateOurs(int descriptor, off64_t size);
int RemoveOurs(const std::string& path, bool folder);

// A folder that is being listed, in place of DIR.
struct Listing {
  int descriptor = -1;
  std::vector<dirent> entries;
  size_t next = 0;
};
std::set<Listing*>& Listings();
DIR* ListOurs(int descriptor);

// Stat: stat or stat64.
template <typename Stat>
int FillStat(const SimDisk::Node& node, Stat* info) {
  *info = {};
  info->st_dev = 1;
  info->st_ino = node.inode;
  info->st_nlink = 1;
  info->st_mode = node.is_folder ? S_IFDIR | 0700 : S_IFREG | 0600;
  info->st_size = static_cast<off_t>(node.bytes.size());
  info->st_blksize = 4096;
  info->st_mtim.tv_sec = info->st_ctim.tv_sec = static_cast<time_t>(node.version);
  return 0;
}
template <typename Stat>
int StatOurs(const std::string& path, Stat* info) {
  SimDisk::NodePtr node;
  const int error = Machine::Current()->disk().Find(path, &node);
  return error != 0 ? Done(error) : FillStat(*node, info);
}
template <typename Stat>
int StatOpened(int descriptor, Stat* info) {
  const Machine::OpenFile* file = Opened(descriptor);
  return file == nullptr ? Done(EBADF) : FillStat(*file->node, info);
}

}  // namespace sheaf::sim
