// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Formats that need no library: PFM and TGA.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "absl/strings/numbers.h"
#include "absl/strings/string_view.h"
#include "common/image/plain_formats.h"

namespace sheaf {
namespace {

// Takes the next word of a PFM header and one character of white space. Empty for a comment.
absl::string_view TakeWord(std::string_view* left) {
  const size_t end = std::min(left->find_first_of(" \t\r\n"), left->size());
  const std::string_view word = left->substr(0, end);
  left->remove_prefix(std::min(end + 1, left->size()));
  if (word.starts_with('#')) return {};
  return {word.data(), word.size()};
}

float Swapped(float value) {
  std::array<char, sizeof(float)> bytes = std::bit_cast<std::array<char, sizeof(float)>>(value);
  std::ranges::reverse(bytes);
  return std::bit_cast<float>(bytes);
}

// Source: Truevision TGA file format specification, version 2.0 (1991).
constexpr size_t kTgaHeaderBytes = 18;
constexpr uint8_t kTgaColor = 2, kTgaGray = 3, kTgaRuns = 8;  // Image types; runs are added.

// Takes the pixels of a TGA file into `to`. False if there are too few.
bool TakeTgaPixels(std::string_view bytes, bool has_runs, size_t pixel_bytes,
                   std::vector<std::byte>* to) {
  if (!has_runs) {
    if (bytes.size() < to->size()) return false;
    std::memcpy(to->data(), bytes.data(), to->size());
    return true;
  }
  size_t at = 0;
  while (at < to->size()) {
    if (bytes.empty()) return false;
    const auto packet = static_cast<uint8_t>(bytes[0]);
    bytes.remove_prefix(1);
    const bool repeats = (packet & 0x80) != 0;
    const size_t size = (size_t{packet & 0x7fu} + 1) * pixel_bytes;
    const size_t stored = repeats ? pixel_bytes : size;
    if (bytes.size() < stored || to->size() - at < size) return false;
    for (size_t i = 0; i < size; i += stored) std::memcpy(&(*to)[at + i], bytes.data(), stored);
    bytes.remove_prefix(stored);
    at += size;
  }
  return true;
}

void FlipRows(PlainImage* image) {
  const size_t row = image->numbers.size() / static_cast<size_t>(image->height);
  std::vector<std::byte> kept(row);
  std::byte *top = image->numbers.data(), *bottom = top + image->numbers.size() - row;
  for (; top < bottom; top += row, bottom -= row) {
    std::memcpy(kept.data(), top, row);
    std::memcpy(top, bottom, row);
    std::memcpy(bottom, kept.data(), row);
  }
}

}  // namespace

std::optional<PlainImage> ReadPfm(std::string_view bytes, const PlainRequest& request) {
  const absl::string_view magic = TakeWord(&bytes);
  if (magic != "PF" && magic != "Pf") return std::nullopt;
  int64_t width = 0, height = 0;
  float scale = 0;
  if (!absl::SimpleAtoi(TakeWord(&bytes), &width) || !absl::SimpleAtoi(TakeWord(&bytes), &height) ||
      !absl::SimpleAtof(TakeWord(&bytes), &scale) || std::fabs(scale) != 1) {
    return std::nullopt;
  }
  std::optional<PlainImage> image =
      MakePlainImage(width, height, magic == "PF" ? 3 : 1, PlainImage::Type::kFloat, request);
  if (!image || request.is_header_enough) return image;
  if (bytes.size() < image->numbers.size()) return std::nullopt;
  std::memcpy(image->numbers.data(), bytes.data(), image->numbers.size());
  const bool is_little = scale < 0;
  if (is_little != (std::endian::native == std::endian::little)) {
    for (size_t i = 0; i < image->NumberCount(); ++i) {
      const float value = Swapped(NumberAt(*image, i));
      std::memcpy(&image->numbers[i * sizeof(float)], &value, sizeof(float));
    }
  }
  FlipRows(&*image);  // The first row of the file is the lowest.
  return image;
}

std::optional<PlainImage> ReadTga(std::string_view bytes, const PlainRequest& request) {
  if (bytes.size() < kTgaHeaderBytes) return std::nullopt;
  const auto byte = [&](size_t at) { return static_cast<uint8_t>(bytes[at]); };
  const auto number = [&](size_t at) { return byte(at) | byte(at + 1) << 8; };
  const uint8_t type = byte(2) & ~kTgaRuns, depth = byte(16), descriptor = byte(17);
  const bool is_color = type == kTgaColor && depth == 24, is_gray = type == kTgaGray && depth == 8;
  constexpr uint8_t kStartsAtTop = 0x20;
  // No palette, no offset of the image, no alpha, rows from the left.
  if (byte(1) != 0 || (!is_color && !is_gray) || number(8) != 0 || number(10) != 0 ||
      (descriptor & ~kStartsAtTop) != 0) {
    return std::nullopt;
  }
  std::optional<PlainImage> image =
      MakePlainImage(number(12), number(14), is_color ? 3 : 1, PlainImage::Type::kUint8, request);
  const size_t begin = kTgaHeaderBytes + byte(0);  // Behind the name of the image.
  if (!image || request.is_header_enough) return image;
  if (bytes.size() < begin) return std::nullopt;
  const bool has_runs = (byte(2) & kTgaRuns) != 0;
  if (!TakeTgaPixels(bytes.substr(begin), has_runs, is_color ? 3 : 1, &image->numbers)) {
    return std::nullopt;
  }
  if (is_color) {
    std::vector<std::byte>& bgr = image->numbers;
    for (size_t i = 0; i < bgr.size(); i += 3) std::swap(bgr[i], bgr[i + 2]);
  }
  if ((descriptor & kStartsAtTop) == 0) FlipRows(&*image);
  return image;
}

}  // namespace sheaf
