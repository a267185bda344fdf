// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Memory streams for OpenEXR, shared by the codecs of parts and images (exr_codec.h).
#pragma once

#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>

#include <cstddef>
#include <exception>
#include <new>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/exr/exr_header_scan.h"
#include "common/film/exr/part_planes.h"
#include "common/film/tile_geometry.h"

namespace sheaf {

inline constexpr char kMetadataPrefix[] = "sheaf:";
inline constexpr char kTwoWindows[] = "two data windows";

class MemoryInput : public Imf::IStream {
 public:
  explicit MemoryInput(std::string_view bytes) : Imf::IStream("memory"), bytes_(bytes) {}
  bool read(char out[], int size) override;
  uint64_t tellg() override { return position_; }
  void seekg(uint64_t position) override { position_ = position; }

 private:
  std::string_view bytes_;
  uint64_t position_ = 0;
};

class MemoryOutput : public Imf::OStream {
 public:
  explicit MemoryOutput(size_t bytes_expected) : Imf::OStream("memory") {
    bytes_.reserve(bytes_expected);
  }
  void write(const char bytes[], int size) override;
  uint64_t tellp() override { return position_; }
  void seekp(uint64_t position) override { position_ = position; }
  std::string Take() { return std::move(bytes_); }

 private:
  std::string bytes_;
  size_t position_ = 0;
};

// Runs calls of OpenEXR, which reports errors by exceptions, and returns a status.
template <typename Calls>
absl::Status Guard(const Calls& calls) {
  try {
    calls();
    return absl::OkStatus();
  } catch (const std::exception& error) {
    return absl::DataLossError(absl::StrCat("the EXR file is damaged: ", error.what()));
  }
}

// Runs calls that write valid planes to memory, which fail only for lack of it. Throws
// std::bad_alloc, which the caller handles as from any other code.
template <typename Calls>
void WriteToMemory(const Calls& calls) {
  bool out_of_memory = false;
  const absl::Status status = Guard([&] {
    try {
      calls();
    } catch (const std::bad_alloc&) {
      out_of_memory = true;
    }
  });
  if (out_of_memory) throw std::bad_alloc();
  SHEAF_CHECK(status.ok());
}

constexpr PixelRect RectOf(const ExrWindow& window) {
  return {window.x0, window.y0, window.x1, window.y1};
}
inline Imath::Box2i BoxOf(PixelRect rect) {
  return {{rect.x0, rect.y0}, {rect.x1 - 1, rect.y1 - 1}};
}

// rect: the pixels of the planes, row by row.
template <typename Float>
Imf::FrameBuffer FrameBufferOf(const std::vector<NamedPlane<Float>>& planes, PixelRect rect) {
  Imf::FrameBuffer buffer;
  for (const NamedPlane<Float>& plane : planes) {
    buffer.insert(plane.name, Imf::Slice::Make(Imf::FLOAT, plane.pixels, BoxOf(rect)));
  }
  return buffer;
}

void SetText(Imf::Header* header, const std::string& name, const std::string& text);

// Errors: kDataLoss if the file cannot be read, or has another data window. rect: as above.
absl::Status DecodePlanes(std::string_view bytes, PixelRect data_window,
                          const std::vector<NamedPlane<float>>& planes, PixelRect rect);
// A file of the header's data window. rect: as above; contains the window.
std::string EncodePlanes(Imf::Header header, const std::vector<NamedPlane<const float>>& planes,
                         PixelRect rect);

}  // namespace sheaf
