// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/sim/sim_files.h"

#include <fcntl.h>

#include <algorithm>
#include <cstring>

namespace sheaf::sim {

bool IsOurs(const char* path) {
  const size_t length = std::strlen(kSimRoot);
  if (!path || !Machine::Current() || std::strncmp(path, kSimRoot, length) != 0) return false;
  return path[length] == '/' || path[length] == '\0';
}
bool IsOurs(int descriptor) { return descriptor >= Machine::kFirstDescriptor; }

int Done(int error) {
  if (error == 0) return 0;
  errno = error;
  return -1;
}

Machine::OpenFile* Opened(int descriptor) {
  Machine* machine = Machine::Current();
  return machine == nullptr ? nullptr : machine->FindDescriptor(descriptor);
}

int OpenOurs(const std::string& path, int flags) {
  Machine& machine = *Machine::Current();
  SimDisk::NodePtr node;
  const int error = machine.disk().Open(path, (flags & O_CREAT) != 0, (flags & O_TRUNC) != 0,
                                        (flags & O_EXCL) != 0, &node);
  if (error != 0) return Done(error);
  if ((flags & O_DIRECTORY) != 0 && !node->is_folder) return Done(ENOTDIR);
  return machine.AddDescriptor({node, 0, (flags & O_APPEND) != 0});
}

ssize_t ReadOurs(int descriptor, void* buffer, size_t count, uint64_t offset) {
  const Machine::OpenFile* file = Opened(descriptor);
  if (file == nullptr || file->node->is_folder) return Done(EBADF);
  const std::string& bytes = file->node->bytes;
  if (offset >= bytes.size()) return 0;
  const size_t read = std::min<size_t>(count, bytes.size() - offset);
  std::memcpy(buffer, bytes.data() + offset, read);
  return static_cast<ssize_t>(read);
}
ssize_t WriteOurs(int descriptor, const void* bytes, size_t count, uint64_t offset) {
  const Machine::OpenFile* file = Opened(descriptor);
  if (file == nullptr) return Done(EBADF);
  const int error = Machine::Current()->disk().Write(file->node, offset,
                                                     {static_cast<const char*>(bytes), count});
  return error != 0 ? Done(error) : static_cast<ssize_t>(count);
}

int SyncOurs(int descriptor) {
  const Machine::OpenFile* file = Opened(descriptor);
  return Done(file == nullptr ? EBADF : Machine::Current()->disk().Sync(file->node));
}
int TruncateOurs(int descriptor, off64_t size) {
  const Machine::OpenFile* file = Opened(descriptor);
  return Done(file == nullptr
                  ? EBADF
                  : Machine::Current()->disk().Truncate(file->node, static_cast<uint64_t>(size)));
}

std::string PathAt(int folder, const char* path) {
  const Machine::OpenFile* file = Opened(folder);
  if (path[0] == '/' || file == nullptr) return path;
  return SimDisk::PathOf(*file->node) + "/" + path;
}
bool IsOursAt(int folder, const char* path) {
  return IsOurs(path) || (IsOurs(folder) && path[0] != '/');
}

std::set<Listing*>& Listings() {
  static auto& listings = *new std::set<Listing*>();
  return listings;
}
bool IsOurs(DIR* folder) { return Listings().contains(reinterpret_cast<Listing*>(folder)); }

DIR* ListOurs(int descriptor) {
  const Machine::OpenFile* file = Opened(descriptor);
  if (file == nullptr || !file->node->is_folder) {
    errno = ENOTDIR;
    return nullptr;
  }
  auto* listing = new Listing{descriptor, {}, 0};
  for (const auto& [name, node] : file->node->entries) {
    dirent entry{};
    entry.d_ino = node->inode;
    entry.d_type = node->is_folder ? DT_DIR : DT_REG;
    name.copy(entry.d_name, sizeof entry.d_name - 1);
    listing->entries.push_back(entry);
  }
  Listings().insert(listing);
  return reinterpret_cast<DIR*>(listing);
}

int RemoveOurs(const std::string& path, bool folder) {
  return Done(Machine::Current()->disk().Remove(path, folder));
}

}  // namespace sheaf::sim
