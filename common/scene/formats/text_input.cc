// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/text_input.h"

#include <sys/stat.h>
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/status.h"

namespace sheaf {
namespace {

// Small files are read at once, with a small buffer: scenes may have many.
constexpr unsigned kReadBufferBytes = 1u << 18, kReadBufferBytesMin = 1u << 12;
// Deflate compresses by at most 1032:1. Source: zlib technical details, "maximum compression
// factor".
constexpr uint64_t kInflateRatioMax = 1032;
constexpr std::string_view kUtf8Mark = "\xef\xbb\xbf";

}  // namespace

absl::StatusOr<std::unique_ptr<TextInput>> TextInput::Open(const std::string& path,
                                                           uint64_t bytes_max) {
  struct stat info {};
  if (::stat(path.c_str(), &info) != 0) return StatusFromErrno(errno, path);
  if (S_ISDIR(info.st_mode))
    return absl::InvalidArgumentError(path + ": is a directory, not a file");
  errno = 0;
  gzFile file = ::gzopen(path.c_str(), "rb");
  if (file == nullptr) return StatusFromErrno(errno == 0 ? ENOMEM : errno, path);
  uint64_t bound = static_cast<uint64_t>(info.st_size);
  const bool size_is_known = S_ISREG(info.st_mode) && bound > 0;
  ::gzbuffer(file, size_is_known ? static_cast<unsigned>(std::clamp<uint64_t>(
                                       bound, kReadBufferBytesMin, kReadBufferBytes))
                                 : kReadBufferBytes);
  if (::gzdirect(file) == 0) bound *= kInflateRatioMax;
  return std::unique_ptr<TextInput>(new TextInput(file, bound, bytes_max));
}

TextInput::~TextInput() { ::gzclose(file_); }

absl::StatusOr<size_t> TextInput::Read(char* into, size_t size) {
  const auto request = static_cast<unsigned>(std::min<size_t>(size, 1u << 30));
  const int count = ::gzread(file_, into, request);
  int error = Z_OK;
  if (count < static_cast<int>(request)) ::gzerror(file_, &error);
  if (error == Z_BUF_ERROR) return absl::DataLossError("the gzip file ends too early (truncated?)");
  if (count < 0 || (error != Z_OK && error != Z_STREAM_END)) {
    if (error == Z_ERRNO) return StatusFromErrno(errno, "reading");
    return absl::DataLossError("the gzip file is damaged");
  }
  const auto bytes = static_cast<uint64_t>(count);
  if (bytes > bytes_left_) {
    return absl::ResourceExhaustedError("the file is larger than the limit file_bytes_max");
  }
  bytes_left_ -= bytes;
  if (std::exchange(has_begun_, true)) return static_cast<size_t>(bytes);
  const std::string_view text(into, bytes);
  if (text.starts_with("\xff\xfe") || text.starts_with("\xfe\xff")) {
    return absl::InvalidArgumentError("the file is text in UTF-16; save it as UTF-8");
  }
  if (!text.starts_with(kUtf8Mark)) return static_cast<size_t>(bytes);
  std::memmove(into, into + kUtf8Mark.size(), bytes - kUtf8Mark.size());
  return bytes > kUtf8Mark.size() ? static_cast<size_t>(bytes - kUtf8Mark.size())
                                  : Read(into, size);
}

}  // namespace sheaf
