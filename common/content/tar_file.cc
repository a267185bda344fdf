// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/content/tar_file.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/base/status.h"

namespace sheaf {
namespace {

// The tar file is a row of blocks: a header and the padded content of each file, then two blocks of
// zeros.
constexpr uint64_t kBlockBytes = 512;
constexpr uint64_t kEndBytes = 2 * kBlockBytes;

// Places in a header.
constexpr size_t kSizeAt = 124, kSizeDigits = 11, kChecksumAt = 148, kChecksumBytes = 8;

uint64_t PaddingOf(uint64_t size_bytes) {
  return (kBlockBytes - size_bytes % kBlockBytes) % kBlockBytes;
}

std::string Octal(uint64_t value, size_t digits) {
  std::string text(digits, '0');
  for (size_t i = digits; i-- > 0; value /= 8) text[i] = static_cast<char>('0' + value % 8);
  return text;
}

std::string HeaderOf(std::string_view name, uint64_t size_bytes) {
  std::string header(kBlockBytes, '\0');
  const auto put = [&](size_t at, std::string_view text) {
    std::copy(text.begin(), text.end(), header.begin() + static_cast<std::ptrdiff_t>(at));
  };
  put(0, name);
  put(100, "0000644");  // Mode.
  put(108, "0000000");  // User.
  put(116, "0000000");  // Group.
  put(kSizeAt, Octal(size_bytes, kSizeDigits));
  put(136, "00000000000");  // Time.
  put(156, "0");            // A regular file.
  put(257, std::string_view("ustar\0"
                            "00",
                            8));
  put(kChecksumAt, std::string(kChecksumBytes, ' '));  // As it counts in the sum itself.
  uint64_t sum = 0;
  for (const char byte : header) sum += static_cast<unsigned char>(byte);
  put(kChecksumAt, Octal(sum, 6) + std::string("\0 ", 2));
  return header;
}

// The entry whose header this is. Errors: kDataLoss.
absl::StatusOr<TarEntry> ParseHeader(const std::string& header, uint64_t offset_bytes) {
  TarEntry entry;
  entry.name = header.substr(0, std::min(header.find('\0'), kTarNameBytesMax));
  entry.offset_bytes = offset_bytes + kBlockBytes;
  for (size_t i = 0; i < kSizeDigits; ++i) {
    entry.size_bytes = entry.size_bytes * 8 + static_cast<uint64_t>(header[kSizeAt + i] & 7);
  }
  if (entry.name.empty() || header != HeaderOf(entry.name, entry.size_bytes)) {
    return absl::DataLossError(absl::StrCat("no header of a file at byte ", offset_bytes,
                                            ": it was altered, or is not a tar file"));
  }
  return entry;
}

bool IsZero(std::string_view bytes) {
  return std::ranges::all_of(bytes, [](char byte) { return byte == '\0'; });
}

absl::Status CutShort(uint64_t size_bytes) {
  return absl::DataLossError(absl::StrCat("it ends too early, after ", size_bytes, " bytes"));
}

}  // namespace

absl::StatusOr<std::unique_ptr<TarWriter>> TarWriter::Create(const std::string& path) {
  std::unique_ptr<TarWriter> writer(new TarWriter(path));
  writer->file_.open(path, std::ios::binary | std::ios::trunc);
  if (!writer->file_) return StatusFromErrno(errno, absl::StrCat("creating ", path));
  return writer;
}

absl::Status TarWriter::Write(std::string_view bytes) {
  file_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  if (!file_) return StatusFromErrno(errno, absl::StrCat("writing ", path_));
  return absl::OkStatus();
}

absl::Status TarWriter::Begin(std::string_view name, uint64_t size_bytes) {
  SHEAF_CHECK(bytes_left_ == 0 && !name.empty() && name.size() <= kTarNameBytesMax);
  if (size_bytes > kTarFileBytesMax) {
    return absl::InvalidArgumentError(absl::StrCat(std::string(name), " has ", size_bytes,
                                                   " bytes, a file in a tar file at most ",
                                                   kTarFileBytesMax));
  }
  size_bytes_ = bytes_left_ = size_bytes;
  return Write(HeaderOf(name, size_bytes));
}

absl::Status TarWriter::Append(std::string_view bytes) {
  if (bytes.size() > bytes_left_) {
    return absl::InvalidArgumentError(
        absl::StrCat("more bytes for ", path_, " than its file of ", size_bytes_, " bytes has"));
  }
  if (bytes.empty()) return absl::OkStatus();
  bytes_left_ -= bytes.size();
  if (absl::Status status = Write(bytes); !status.ok()) return status;
  return bytes_left_ > 0 ? absl::OkStatus() : Write(std::string(PaddingOf(size_bytes_), '\0'));
}

absl::Status TarWriter::Finish() {
  SHEAF_CHECK(bytes_left_ == 0);
  if (absl::Status status = Write(std::string(kEndBytes, '\0')); !status.ok()) return status;
  file_.close();
  if (!file_) return StatusFromErrno(errno, absl::StrCat("writing ", path_));
  return absl::OkStatus();
}

absl::StatusOr<std::vector<TarEntry>> ListTar(const ReadBytesAt& read, uint64_t size_bytes,
                                              size_t entry_count_max) {
  std::vector<TarEntry> entries;
  uint64_t at = 0;
  while (true) {
    if (size_bytes - at < kEndBytes) return CutShort(size_bytes);
    const absl::StatusOr<std::string> header = read(at, kBlockBytes);
    if (!header.ok()) return header.status();
    if (IsZero(*header)) break;
    absl::StatusOr<TarEntry> entry = ParseHeader(*header, at);
    if (!entry.ok()) return entry.status();
    if (entries.size() >= entry_count_max) {
      return absl::ResourceExhaustedError(
          absl::StrCat("it holds more than ", entry_count_max, " files"));
    }
    const uint64_t padding = PaddingOf(entry->size_bytes);
    at = entry->offset_bytes + entry->size_bytes;  // No overflow: each is far below 2^63.
    if (at + padding > size_bytes) return CutShort(size_bytes);
    const absl::StatusOr<std::string> zeros = read(at, padding);
    if (!zeros.ok()) return zeros.status();
    if (!IsZero(*zeros)) {
      return absl::DataLossError(absl::StrCat("the padding at byte ", at, " was altered"));
    }
    at += padding;
    entries.push_back(*std::move(entry));
  }
  if (size_bytes - at != kEndBytes) {
    return absl::DataLossError(absl::StrCat("it has more bytes than its end at byte ", at));
  }
  const absl::StatusOr<std::string> last = read(at + kBlockBytes, kBlockBytes);
  if (!last.ok()) return last.status();
  if (!IsZero(*last)) return absl::DataLossError("its last block was altered");
  return entries;
}

absl::StatusOr<ReadBytesAt> OpenForReading(const std::string& path, uint64_t* size_bytes) {
  const auto file = std::make_shared<std::ifstream>(path, std::ios::binary | std::ios::ate);
  if (!*file) return StatusFromErrno(errno, absl::StrCat("opening ", path));
  const std::streamoff end = file->tellg();
  if (end < 0) return absl::DataLossError(path + ": cannot be read; is it a file?");
  *size_bytes = static_cast<uint64_t>(end);
  return [file, path](uint64_t offset_bytes, uint64_t count) -> absl::StatusOr<std::string> {
    std::string bytes(count, '\0');
    file->clear();
    file->seekg(static_cast<std::streamoff>(offset_bytes));
    file->read(bytes.data(), static_cast<std::streamsize>(count));
    if (static_cast<uint64_t>(file->gcount()) != count) {
      return absl::DataLossError(absl::StrCat(path, ": cannot be read at byte ", offset_bytes));
    }
    return bytes;
  };
}

}  // namespace sheaf
