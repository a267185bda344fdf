// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/vdb_wire.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

namespace sheaf::volume {
namespace {

constexpr size_t kPartBytesMax = size_t{1} << 30;

void Append(std::string_view text, std::string* bytes) {
  const auto size = static_cast<uint32_t>(text.size());
  bytes->append(reinterpret_cast<const char*>(&size), sizeof(size));
  bytes->append(text);
}

bool Take(std::string_view* bytes, std::string* text) {
  uint32_t size = 0;
  if (bytes->size() < sizeof(size)) return false;
  std::memcpy(&size, bytes->data(), sizeof(size));
  bytes->remove_prefix(sizeof(size));
  if (bytes->size() < size) return false;
  *text = bytes->substr(0, size);
  bytes->remove_prefix(size);
  return true;
}

}  // namespace

// By write and read: a filter of system calls permits no others.
bool SendAll(int socket, const void* bytes, size_t size_bytes) {
  const auto* at = static_cast<const char*>(bytes);
  while (size_bytes > 0) {
    const ssize_t sent = ::write(socket, at, std::min(size_bytes, kPartBytesMax));
    if (sent < 0 && errno == EINTR) continue;
    if (sent <= 0) return false;
    at += sent;
    size_bytes -= static_cast<size_t>(sent);
  }
  return true;
}

bool ReceiveAll(int socket, void* bytes, size_t size_bytes) {
  auto* at = static_cast<char*>(bytes);
  while (size_bytes > 0) {
    const ssize_t got = ::read(socket, at, std::min(size_bytes, kPartBytesMax));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    at += got;
    size_bytes -= static_cast<size_t>(got);
  }
  return true;
}

std::string EncodeVdbList(const std::vector<VolumeFileEntry>& entries) {
  std::string bytes;
  for (const VolumeFileEntry& entry : entries) {
    bytes.push_back(entry.can_be_read ? 1 : 0);
    Append(entry.name, &bytes);
    Append(entry.type_name, &bytes);
  }
  return bytes;
}

absl::StatusOr<std::vector<VolumeFileEntry>> DecodeVdbList(std::string_view bytes) {
  std::vector<VolumeFileEntry> entries;
  while (!bytes.empty()) {
    VolumeFileEntry entry;
    entry.can_be_read = bytes.front() != 0;
    bytes.remove_prefix(1);
    if (!Take(&bytes, &entry.name) || !Take(&bytes, &entry.type_name)) {
      return absl::InvalidArgumentError("the list of grids is malformed");
    }
    entries.push_back(std::move(entry));
  }
  return entries;
}

}  // namespace sheaf::volume
