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

Texel ResidentTexture::At(TexelIndex where) const {
  const PlainImage& image = *image_;
  const size_t begin = (static_cast<size_t>(where.y) * static_cast<size_t>(image.width) +
                        static_cast<size_t>(where.x)) *
                       static_cast<size_t>(image.channels);
  const auto channels = static_cast<size_t>(facts_.channels);
  const std::byte* numbers = image.numbers.data();
  Texel texel{};
  if (image.type == PlainImage::Type::kUint8) {
    for (size_t c = 0; c < channels; ++c) {
      texel[c] = decode_[std::to_integer<size_t>(numbers[begin + c])];
    }
  } else if (image.type == PlainImage::Type::kFloat) {
    for (size_t c = 0; c < channels; ++c) {
      float value;
      std::memcpy(&value, numbers + (begin + c) * sizeof(float), sizeof(float));
      texel[c] = std::isfinite(value) ? value : 0;
    }
  } else {
    for (size_t c = 0; c < channels; ++c) {
      uint16_t value;
      std::memcpy(&value, numbers + (begin + c) * sizeof(uint16_t), sizeof(uint16_t));
      texel[c] = decode_[value];
    }
  }
  return texel;
}

}  // namespace sheaf
