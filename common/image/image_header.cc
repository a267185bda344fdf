// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/image/image_header.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string_view>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "common/exr/exr_header_scan.h"
#include "common/image/image_limits.h"

namespace sheaf {
namespace {

absl::Status CheckExr(const std::string& path, const ExrFileHeader& file) {
  for (const ExrHeader& part : file.parts) {
    for (const ExrWindow& window : {part.data_window, part.display_window}) {
      ImageClaim claim;
      claim.width = int64_t{window.x1} - window.x0;
      claim.height = int64_t{window.y1} - window.y0;
      claim.channels = static_cast<int64_t>(part.channels.size());
      if (part.tile_pixels > 0) claim.tile_pixels = part.tile_pixels;
      if (absl::Status status = CheckImageClaim(path, claim); !status.ok()) return status;
    }
  }
  return absl::OkStatus();
}

// A file whose numbers are taken at any place; those beyond its end are 0.
class Bytes {
 public:
  explicit Bytes(const std::string& path) : file_(path, std::ios::binary) {}
  std::string At(uint64_t begin, size_t size) {
    std::string bytes(size, '\0');
    file_.clear();
    file_.seekg(static_cast<std::streamoff>(begin));
    file_.read(bytes.data(), static_cast<std::streamsize>(size));
    return bytes;
  }
  uint64_t BigEndian(uint64_t begin, size_t size) {
    uint64_t value = 0;
    for (const char c : At(begin, size)) value = value << 8 | static_cast<unsigned char>(c);
    return value;
  }

 private:
  std::ifstream file_;
};

// Source: GIF89a specification, sec. 18; OpenImageIO keeps a canvas of four channels.
ImageClaim ClaimOfGif(Bytes& bytes) {
  const std::string size = bytes.At(6, 4);
  const auto at = [&](size_t i) {
    return static_cast<int64_t>(static_cast<unsigned char>(size[i]));
  };
  return {.width = at(0) | at(1) << 8,
          .height = at(2) | at(3) << 8,
          .channels = 4,
          .is_read_whole = true};
}

constexpr std::string_view kPngHead("\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR", 16);

// Source: PNG specification, sec. 11.2.2. The rows of an interlaced image lie all over it.
ImageClaim ClaimOfPng(Bytes& bytes) {
  const auto byte = [&](uint64_t at) { return bytes.BigEndian(at, 1); };
  constexpr std::array<int64_t, 7> kChannels{1, 1, 3, 4, 2, 1, 4};  // By color type; 3: a palette.
  return {.width = static_cast<int64_t>(bytes.BigEndian(16, 4)),
          .height = static_cast<int64_t>(bytes.BigEndian(20, 4)),
          .channels = kChannels[std::min<uint64_t>(byte(25), kChannels.size() - 1)],
          .is_read_whole = byte(28) != 0};
}

// The library takes the memory that a chunk claims before it reads it; pixels it reads in pieces.
// Source: PNG specification, sec. 5.3.
absl::Status CheckPngChunks(const std::string& path, Bytes& bytes, uint64_t file_size) {
  constexpr uint64_t kSignatureBytes = 8, kFrameBytes = 12;  // Length, type and check sum.
  uint64_t at = kSignatureBytes;
  while (at + kFrameBytes <= file_size) {
    const uint64_t size = bytes.BigEndian(at, 4), left = file_size - at - kFrameBytes;
    const std::string type = bytes.At(at + 4, 4);
    if (type == "IEND") break;
    if (size <= left) {
      at += kFrameBytes + size;
      continue;
    }
    if (type == "IDAT") break;
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": not a readable image: a chunk at byte ", at, " claims ", size,
                     " bytes, but the file has ", left, " more; it is cut short or damaged"));
  }
  return absl::OkStatus();
}

constexpr std::string_view kCodestream("\xff\x4f\xff\x51", 4);
constexpr std::string_view kJp2Signature("\0\0\0\x0cjP  \r\n\x87\n", 12);

// Source: ISO/IEC 15444-1, annexes A.5.1 and I.4: boxes, of which one is the codestream.
std::optional<uint64_t> CodestreamOf(Bytes& bytes, uint64_t file_size) {
  if (bytes.At(0, kCodestream.size()) == kCodestream) return 0;
  if (bytes.At(0, kJp2Signature.size()) != kJp2Signature) return std::nullopt;
  uint64_t box = 0;
  while (box + 16 <= file_size) {
    uint64_t size = bytes.BigEndian(box, 4), head = 8;
    const std::string type = bytes.At(box + 4, 4);
    if (size == 1) {
      size = bytes.BigEndian(box + 8, 8);
      head = 16;
    }
    if (type == "jp2c") return box + head;
    if (size < head || size > file_size - box) return std::nullopt;
    box += size;
  }
  return std::nullopt;
}

ImageClaim ClaimOfCodestream(Bytes& bytes, uint64_t begin) {
  const auto number = [&](uint64_t at, size_t size) {
    return static_cast<int64_t>(bytes.BigEndian(begin + at, size));
  };
  return {.width = number(8, 4) - number(16, 4),
          .height = number(12, 4) - number(20, 4),
          .channels = number(40, 2),
          .is_read_whole = true};
}

}  // namespace

absl::Status CheckImageHeader(const std::string& path) {
  std::error_code code;
  if (!std::filesystem::is_regular_file(path, code)) {
    return absl::NotFoundError(absl::StrCat(path, ": no such file"));
  }
  const absl::StatusOr<std::optional<ExrFileHeader>> exr = ReadExrHeader(path);
  if (!exr.ok()) return exr.status();
  if (*exr) return CheckExr(path, **exr);
  const uint64_t file_size = std::filesystem::file_size(path, code);
  if (code) return absl::OkStatus();  // The library says what is wrong.
  Bytes bytes(path);
  if (bytes.At(0, kPngHead.size()) == kPngHead) {
    if (absl::Status status = CheckPngChunks(path, bytes, file_size); !status.ok()) return status;
    return CheckImageClaim(path, ClaimOfPng(bytes));
  }
  if (bytes.At(0, 4) == "GIF8") return CheckImageClaim(path, ClaimOfGif(bytes));
  if (const auto codestream = CodestreamOf(bytes, file_size)) {
    return CheckImageClaim(path, ClaimOfCodestream(bytes, *codestream));
  }
  return absl::OkStatus();
}

}  // namespace sheaf
