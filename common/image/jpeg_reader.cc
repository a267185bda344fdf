// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <csetjmp>
#include <cstdio>

#include <jpeglib.h>

#include "common/image/plain_formats.h"

namespace sheaf {
namespace {

struct Decoder {
  jpeg_decompress_struct jpeg{};
  jpeg_error_mgr errors{};
  std::jmp_buf on_error{};
};

void StopDecoding(j_common_ptr jpeg) {
  std::longjmp(static_cast<Decoder*>(jpeg->client_data)->on_error, 1);
}
// A file that is cut short, or damaged, makes a warning.
void StopOnWarning(j_common_ptr jpeg, int level) {
  if (level < 0) StopDecoding(jpeg);
}
void IgnoreText(j_common_ptr) {}

// These are false after an error. Nothing in them may have a destructor: errors arrive by longjmp.
bool ReadHeader(Decoder* decoder, std::string_view bytes) {
  jpeg_decompress_struct& jpeg = decoder->jpeg;
  if (setjmp(decoder->on_error) != 0) return false;
  jpeg_create_decompress(&jpeg);
  jpeg_mem_src(&jpeg, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
  jpeg_read_header(&jpeg, TRUE);
  const bool is_gray = jpeg.num_components == 1 && jpeg.out_color_space == JCS_GRAYSCALE;
  const bool is_color = jpeg.num_components == 3 && jpeg.out_color_space == JCS_RGB;
  return (is_gray || is_color) && jpeg.data_precision == 8;
}
bool ReadRows(Decoder* decoder, std::byte* to, size_t row_bytes) {
  jpeg_decompress_struct& jpeg = decoder->jpeg;
  if (setjmp(decoder->on_error) != 0) return false;
  jpeg_start_decompress(&jpeg);
  while (jpeg.output_scanline < jpeg.output_height) {
    JSAMPROW row = reinterpret_cast<JSAMPROW>(to + jpeg.output_scanline * row_bytes);
    jpeg_read_scanlines(&jpeg, &row, 1);
  }
  jpeg_finish_decompress(&jpeg);
  return true;
}

}  // namespace

std::optional<PlainImage> ReadJpeg(std::string_view bytes, const PlainRequest& request) {
  if (!bytes.starts_with("\xff\xd8\xff")) return std::nullopt;
  Decoder decoder;
  decoder.jpeg.err = jpeg_std_error(&decoder.errors);
  decoder.jpeg.client_data = &decoder;
  decoder.errors.error_exit = StopDecoding;
  decoder.errors.emit_message = StopOnWarning;
  decoder.errors.output_message = IgnoreText;
  std::optional<PlainImage> image;
  if (ReadHeader(&decoder, bytes)) {
    image = MakePlainImage(decoder.jpeg.image_width, decoder.jpeg.image_height,
                           decoder.jpeg.num_components, PlainImage::Type::kUint8, request);
  }
  if (image && !request.is_header_enough &&
      !ReadRows(&decoder, image->numbers.data(),
                static_cast<size_t>(image->width * image->channels))) {
    image = std::nullopt;
  }
  jpeg_destroy_decompress(&decoder.jpeg);
  return image;
}

}  // namespace sheaf
