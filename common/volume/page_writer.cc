// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/page_writer.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "common/base/status.h"
#include "common/volume/codecs.h"

namespace sheaf::volume {
namespace {

template <typename T>
void Append(const T* values, size_t count, std::string* bytes) {
  static_assert(std::is_trivially_copyable_v<T>);
  bytes->append(reinterpret_cast<const char*>(values), count * sizeof(T));
}

}  // namespace

absl::StatusOr<PageWriter> PageWriter::Create(const std::string& path) {
  PageWriter writer;
  writer.path_ = path;
  writer.part_path_ = absl::StrCat(path, ".part-", ::getpid());
  writer.descriptor_ =
      ::open(writer.part_path_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (writer.descriptor_ < 0) return StatusFromErrno(errno, absl::StrCat("writing ", path));
  const absl::Status status = writer.Write(&kPageMagic, sizeof(kPageMagic));
  if (!status.ok()) return status;
  return writer;
}

PageWriter::PageWriter(PageWriter&& other) noexcept
    : path_(std::move(other.path_)),
      part_path_(std::move(other.part_path_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      offset_(other.offset_) {}

PageWriter::~PageWriter() {
  if (descriptor_ < 0) return;
  ::close(descriptor_);
  ::unlink(part_path_.c_str());
}

absl::Status PageWriter::Write(const void* bytes, uint64_t size) {
  const auto* at = static_cast<const char*>(bytes);
  offset_ += size;
  while (size > 0) {
    const ssize_t wrote = ::write(descriptor_, at, size);
    if (wrote < 0 && errno == EINTR) continue;
    if (wrote < 0) return StatusFromErrno(errno, absl::StrCat("writing ", path_));
    at += wrote;
    size -= static_cast<uint64_t>(wrote);
  }
  return absl::OkStatus();
}

absl::Status PageWriter::AddPage(std::span<const std::byte> leaves, size_t value_bytes,
                                 PageEntry* entry) {
  const std::vector<std::byte> packed = PackBlosc(leaves, value_bytes);
  if (packed.empty()) return absl::InternalError(absl::StrCat(path_, ": a page does not pack"));
  const std::string digest =
      BytesOfHex(Sha256Hex({reinterpret_cast<const char*>(packed.data()), packed.size()}));
  std::memcpy(entry->sha256.data(), digest.data(), entry->sha256.size());
  entry->offset_bytes = offset_;
  entry->bytes = static_cast<uint32_t>(leaves.size());
  entry->packed_bytes = static_cast<uint32_t>(packed.size());
  return Write(packed.data(), packed.size());
}

absl::Status PageWriter::Finish(std::span<const PageIndex> grids) {
  std::string index;
  for (const PageIndex& grid : grids) {
    Append(&grid.head, 1, &index);
    Append(grid.root_tiles.data(), grid.root_tiles.size(), &index);
    Append(grid.regions.data(), grid.regions.size(), &index);
    Append(grid.entries.data(), grid.entries.size(), &index);
  }
  PageTrailer trailer{};
  trailer.index_offset_bytes = offset_;
  trailer.index_bytes = index.size();
  const std::string digest = Sha256Hex(index);
  std::memcpy(trailer.index_sha256.data(), digest.data(), trailer.index_sha256.size());
  trailer.grid_count = static_cast<uint32_t>(grids.size());
  trailer.version = kPageVersion;
  trailer.magic = kPageMagic;
  Append(&trailer, 1, &index);
  absl::Status status = Write(index.data(), index.size());
  if (!status.ok()) return status;
  if (::fsync(descriptor_) != 0 || ::rename(part_path_.c_str(), path_.c_str()) != 0) {
    return StatusFromErrno(errno, absl::StrCat("writing ", path_));
  }
  ::close(std::exchange(descriptor_, -1));
  return absl::OkStatus();
}

}  // namespace sheaf::volume
