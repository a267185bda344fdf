// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include <png.h>

#include <csetjmp>
#include <new>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/image/png_tags.h"

namespace sheaf {
namespace {

// The output that libpng writes to; it is C, so no exception may pass through it.
struct Sink {
  std::string bytes, error;
};

[[noreturn]] void OnError(png_structp png, png_const_charp message) {
  static_cast<Sink*>(png_get_error_ptr(png))->error = message;
  png_longjmp(png, 1);
}
void OnWarning(png_structp, png_const_charp) {}

void Append(png_structp png, png_bytep data, size_t size) {
  bool full = false;
  try {
    static_cast<Sink*>(png_get_io_ptr(png))->bytes.append(reinterpret_cast<char*>(data), size);
  } catch (const std::bad_alloc&) {
    full = true;
  }
  if (full) png_error(png, "out of memory");
}
void Flush(png_structp) {}

// False after an error. Nothing in here may have a destructor: errors arrive by longjmp.
bool WriteAll(png_structp png, png_infop info, int width, int height, const Rgb8* pixels,
              const PngTags& tags) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_set_IHDR(png, info, static_cast<png_uint_32>(width), static_cast<png_uint_32>(height), 8,
               PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  if (tags.is_srgb) png_set_sRGB_gAMA_and_cHRM(png, info, PNG_sRGB_INTENT_RELATIVE);
  for (const auto& [keyword, text] : tags.text) {
    png_text entry{};
    entry.compression = PNG_TEXT_COMPRESSION_NONE;
    // libpng copies both and changes neither.
    entry.key = const_cast<char*>(keyword.c_str());
    entry.text = const_cast<char*>(text.c_str());
    entry.text_length = text.size();
    png_set_text(png, info, &entry, 1);
  }
  png_write_info(png, info);
  for (int y = 0; y < height; ++y) {
    png_write_row(png, reinterpret_cast<png_const_bytep>(pixels + static_cast<size_t>(y) *
                                                                      static_cast<size_t>(width)));
  }
  png_write_end(png, info);
  return true;
}

}  // namespace

absl::StatusOr<std::string> EncodePng(int width, int height, const std::vector<Rgb8>& pixels) {
  return EncodeTaggedPng(width, height, pixels, {});
}

absl::StatusOr<std::string> EncodeTaggedPng(int width, int height, const std::vector<Rgb8>& pixels,
                                            const PngTags& tags) {
  SHEAF_CHECK(width > 0 && height > 0);
  SHEAF_CHECK(pixels.size() == static_cast<size_t>(width) * static_cast<size_t>(height));
  static_assert(sizeof(Rgb8) == 3, "pixels are handed over as packed bytes");
  Sink sink;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &sink, OnError, OnWarning);
  png_infop info = png == nullptr ? nullptr : png_create_info_struct(png);
  bool written = false;
  if (info != nullptr) {
    png_set_write_fn(png, &sink, Append, Flush);
    written = WriteAll(png, info, width, height, pixels.data(), tags);
  }
  png_destroy_write_struct(&png, &info);
  if (written) return std::move(sink.bytes);
  return absl::InternalError(absl::StrCat(
      "PNG encoding failed: ", sink.error.empty() ? "libpng cannot be started" : sink.error));
}

}  // namespace sheaf
