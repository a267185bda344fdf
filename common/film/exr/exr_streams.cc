// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/exr/exr_streams.h"

#include <ImfChannelList.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>
#include <ImfStringAttribute.h>

#include <cstring>
#include <new>
#include <stdexcept>

#include "common/base/check.h"

namespace sheaf {
bool MemoryInput::read(char out[], int size) {
  // OpenEXR expects an exception here and converts it into one of its own; Guard catches those.
  if (size < 0 || position_ > bytes_.size() ||
      bytes_.size() - position_ < static_cast<size_t>(size)) {
    throw std::out_of_range("unexpected end of file");
  }
  std::memcpy(out, bytes_.data() + position_, static_cast<size_t>(size));
  position_ += static_cast<size_t>(size);
  return position_ < bytes_.size();
}

void MemoryOutput::write(const char bytes[], int size) {
  const size_t end = position_ + static_cast<size_t>(size);
  if (bytes_.size() < end) bytes_.resize(end);
  std::memcpy(bytes_.data() + position_, bytes, static_cast<size_t>(size));
  position_ = end;
}

void SetText(Imf::Header* header, const std::string& name, const std::string& text) {
  header->insert(name, Imf::StringAttribute(text));
}

absl::Status DecodePlanes(std::string_view bytes, PixelRect data_window,
                          const std::vector<NamedPlane<float>>& planes, PixelRect rect) {
  return Guard([&] {
    MemoryInput input(bytes);
    Imf::InputFile file(input, 0);
    if (file.header().dataWindow() != BoxOf(data_window)) throw std::runtime_error(kTwoWindows);
    file.setFrameBuffer(FrameBufferOf(planes, rect));
    file.readPixels(data_window.y0, data_window.y1 - 1);
  });
}

std::string EncodePlanes(Imf::Header header, const std::vector<NamedPlane<const float>>& planes,
                         PixelRect rect) {
  // The size of uncompressed lines, plus more than a header needs.
  constexpr size_t kHeaderBytes = 1 << 14;
  const bool raw = header.compression() == Imf::NO_COMPRESSION;
  MemoryOutput output(
      kHeaderBytes +
      (raw ? static_cast<size_t>(rect.PixelCount()) * planes.size() * sizeof(float) : 0));
  WriteToMemory([&] {
    for (const auto& plane : planes) header.channels().insert(plane.name, Imf::Channel(Imf::FLOAT));
    Imf::OutputFile file(output, header, 0);
    file.setFrameBuffer(FrameBufferOf(planes, rect));
    file.writePixels(header.dataWindow().max.y - header.dataWindow().min.y + 1);
  });
  return output.Take();
}

}  // namespace sheaf
