// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/image/resident_texture.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

namespace sheaf {
namespace {

constexpr size_t kCount8 = 256, kCount16 = 65536;

std::vector<float> DecodeTable(PlainImage::Type type, TexelEncoding encoding) {
  switch (type) {
    case PlainImage::Type::kUint8:
      return TexelDecodeTable(encoding, kCount8);
    case PlainImage::Type::kUint16:
      return TexelDecodeTable(encoding, kCount16);
    case PlainImage::Type::kHalf: {
      std::vector<float> table(kCount16);
      for (size_t i = 0; i < kCount16; ++i) {
        const float value = FloatOfHalf(static_cast<uint16_t>(i));
        table[i] = std::isfinite(value) ? value : 0;
      }
      return table;
    }
    case PlainImage::Type::kFloat:
      break;
  }
  return {};
}

// Counts texels with numbers that are not finite, and drops an alpha that is 1 everywhere, as
// pbrt-v4 does.
void Scan(const PlainImage& image, TextureImage* facts) {
  const auto channels = static_cast<size_t>(image.channels);
  if (image.IsInteger() && channels < 4) return;
  bool is_opaque = true;
  for (size_t at = 0; at < image.NumberCount(); at += channels) {
    bool finite = true;
    for (size_t c = 0; c < channels; ++c) finite &= std::isfinite(NumberAt(image, at + c));
    if (!finite) ++facts->non_finite_texels;
    is_opaque = is_opaque && (channels < 4 || NumberAt(image, at + 3) == 1);
  }
  if (is_opaque) facts->channels = std::min(facts->channels, 3);
}

}  // namespace

TextureImage FactsOf(const PlainImage& image) {
  TextureImage facts;
  facts.width = image.width;
  facts.height = image.height;
  facts.channels = image.channels;
  facts.chromaticities = image.chromaticities;
  return facts;
}

ResidentTexture::ResidentTexture(std::shared_ptr<const PlainImage> image, TexelEncoding encoding)
    : image_(std::move(image)), facts_(FactsOf(*image_)) {
  Scan(*image_, &facts_);
  decode_ = DecodeTable(image_->type, encoding);
}

namespace {

// Reads the numbers of one texel, decoded by decode(number). Number: that of the file.
template <typename Number, typename Decode>
Texel TexelOf(const std::byte* numbers, size_t channels, const Decode& decode) {
  Texel texel{};
  for (size_t c = 0; c < channels; ++c) {
    Number number;
    std::memcpy(&number, numbers + c * sizeof(Number), sizeof(Number));
    texel[c] = decode(number);
  }
  return texel;
}

}  // namespace

template <typename Number, typename Decode>
void ResidentTexture::ReadAs(std::span<const TexelIndex> where, std::span<Texel> values,
                             const Decode& decode) const {
  const PlainImage& image = *image_;
  const auto stored = static_cast<size_t>(image.channels) * sizeof(Number);
  const auto at = [&](TexelIndex texel) {
    const size_t index = static_cast<size_t>(texel.y) * static_cast<size_t>(image.width) +
                         static_cast<size_t>(texel.x);
    return image.numbers.data() + index * stored;
  };
  // The texels of one look-up lie in two rows: both are on their way before one is decoded.
  for (const TexelIndex& texel : where) __builtin_prefetch(at(texel));
  const auto read = [&](size_t channels) {
    for (size_t i = 0; i < where.size(); ++i) {
      values[i] = TexelOf<Number>(at(where[i]), channels, decode);
    }
  };
  // Most images; the number of channels unrolls the loop.
  facts_.channels == 3 ? read(3) : read(static_cast<size_t>(facts_.channels));
}

void ResidentTexture::ReadTexels(std::span<const TexelIndex> where, std::span<Texel> values) const {
  const float* decode = decode_.data();
  switch (image_->type) {
    case PlainImage::Type::kUint8:
      return ReadAs<uint8_t>(where, values, [decode](uint8_t number) { return decode[number]; });
    case PlainImage::Type::kUint16:
    case PlainImage::Type::kHalf:
      return ReadAs<uint16_t>(where, values, [decode](uint16_t number) { return decode[number]; });
    case PlainImage::Type::kFloat:
      return ReadAs<float>(where, values,
                           [](float number) { return std::isfinite(number) ? number : 0; });
  }
}

}  // namespace sheaf
