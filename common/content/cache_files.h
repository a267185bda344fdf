// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The files of a worker's content cache, as eviction sees them: which lie there, which leases link
// to, and which may go. ContentCache alone uses this, with the cache's lock held.
#pragma once

#include <time.h>

#include <cstdint>
#include <string>
#include <vector>

#include "common/content/file_descriptor.h"

namespace sheaf {

// A file that eviction may remove: a blob without a lease, or an interrupted download.
struct Evictable {
  timespec used{};
  std::string path;
  uint64_t size_bytes = 0;
  bool partial = false;
};

bool UsedBefore(const Evictable& a, const Evictable& b);

// Empty if it cannot be read.
std::vector<std::string> ListDirectory(const std::string& path);

// The file with its lock held, or an invalid descriptor if another process holds it.
FileDescriptor LockIfFree(const std::string& path);

// 0 if there is no such file.
uint64_t SizeOf(const std::string& path);

// The file whose time records the last use of a blob.
std::string StampPath(const std::string& cache, const std::string& sha256_hex);

// The folders of all leases, of all processes.
std::vector<std::string> LeaseDirectories(const std::string& cache);

// Scans everything below the cache's blobs: adds its size to used_bytes, and to evictable the files
// that may go.
void ScanBlobs(const std::string& cache, const std::string& blobs, uint64_t* used_bytes,
               std::vector<Evictable>* evictable);

// Whether the file is gone: another process may have begun to write it.
bool Evict(const Evictable& victim);

}  // namespace sheaf
