// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include <png.h>

#include <algorithm>
#include <bit>
#include <csetjmp>
#include <cstring>

#include "common/image/plain_formats.h"

namespace sheaf {
namespace {

constexpr size_t kSignatureBytes = 8;

[[noreturn]] void StopReading(png_structp png, png_const_charp) { png_longjmp(png, 1); }
void IgnoreWarning(png_structp, png_const_charp) {}
void Take(png_structp png, png_bytep to, size_t size) {
  auto* left = static_cast<std::string_view*>(png_get_io_ptr(png));
  if (left->size() < size) png_error(png, "cut short");
  std::memcpy(to, left->data(), size);
  left->remove_prefix(size);
}

struct Form {
  int64_t width = 0, height = 0;
  int channels = 0;  // As libpng delivers them: 2 are gray and alpha.
  bool is_16bit = false;
};

// False after an error. Nothing in here may have a destructor: errors arrive by longjmp.
bool ReadForm(png_structp png, png_infop info, Form* form) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_read_info(png, info);
  const int color = png_get_color_type(png, info), depth = png_get_bit_depth(png, info);
  if (color == PNG_COLOR_TYPE_PALETTE) png_set_palette_to_rgb(png);
  if (color == PNG_COLOR_TYPE_GRAY && depth < 8) png_set_expand_gray_1_2_4_to_8(png);
  if (png_get_valid(png, info, PNG_INFO_tRNS) != 0) png_set_tRNS_to_alpha(png);
  if (depth == 16 && std::endian::native == std::endian::little) png_set_swap(png);
  png_set_interlace_handling(png);
  png_read_update_info(png, info);
  form->width = png_get_image_width(png, info);
  form->height = png_get_image_height(png, info);
  form->channels = png_get_channels(png, info);
  form->is_16bit = png_get_bit_depth(png, info) == 16;
  return true;
}
bool ReadRows(png_structp png, png_bytepp rows) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_read_image(png, rows);
  png_read_end(png, nullptr);
  return true;
}

// Leaves the gray of gray and alpha.
void DropAlphaOfGray(PlainImage* image) {
  const size_t size = image->NumberBytes();
  std::byte* numbers = image->numbers.data();
  const size_t pixels = image->NumberCount() / 2;
  for (size_t i = 1; i < pixels; ++i) std::memcpy(numbers + i * size, numbers + 2 * i * size, size);
  image->numbers.resize(pixels * size);
  image->channels = 1;
}

std::optional<PlainImage> ReadAll(png_structp png, png_infop info, const PlainRequest& request) {
  Form form;
  if (!ReadForm(png, info, &form)) return std::nullopt;
  const auto type = form.is_16bit ? PlainImage::Type::kUint16 : PlainImage::Type::kUint8;
  std::optional<PlainImage> image =
      MakePlainImage(form.width, form.height, form.channels, type, request);
  if (!image || request.is_header_enough) {
    if (image && form.channels == 2) image->channels = 1;
    return image;
  }
  std::vector<png_bytep> rows;
  const size_t row_bytes = image->numbers.size() / static_cast<size_t>(form.height);
  for (int64_t y = 0; y < form.height; ++y) {
    rows.push_back(reinterpret_cast<png_bytep>(image->numbers.data()) +
                   static_cast<size_t>(y) * row_bytes);
  }
  if (!ReadRows(png, rows.data())) return std::nullopt;
  if (form.channels == 2) DropAlphaOfGray(&*image);
  return image;
}

}  // namespace

std::optional<PlainImage> ReadPng(std::string_view bytes, const PlainRequest& request) {
  if (bytes.size() < kSignatureBytes ||
      png_sig_cmp(reinterpret_cast<png_const_bytep>(bytes.data()), 0, kSignatureBytes) != 0) {
    return std::nullopt;
  }
  png_structp png =
      png_create_read_struct(PNG_LIBPNG_VER_STRING, nullptr, StopReading, IgnoreWarning);
  if (png == nullptr) return std::nullopt;
  png_infop info = png_create_info_struct(png);
  std::optional<PlainImage> image;
  if (info != nullptr) {
    png_set_read_fn(png, &bytes, Take);
    image = ReadAll(png, info, request);
  }
  png_destroy_read_struct(&png, &info, nullptr);
  return image;
}

}  // namespace sheaf
