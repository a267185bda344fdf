// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ResidentTexture: an image that stays in memory as its file stores it, and is decoded where it is
// read. Its texels have the bits of those that TextureTiles reads.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "common/image/plain_image.h"
#include "common/image/texture_cache.h"

namespace sheaf {

class ResidentTexture {
 public:
  ResidentTexture(std::shared_ptr<const PlainImage> image, TexelEncoding encoding);

  // Its `index` is unset.
  const TextureImage& facts() const { return facts_; }
  // values[i] becomes the texel at where[i]. Requires: each is within the image; spans have the
  // same size.
  void ReadTexels(std::span<const TexelIndex> where, std::span<Texel> values) const;

 private:
  // decode(number): the value of a number, as the file has it.
  template <typename Number, typename Decode>
  void ReadAs(std::span<const TexelIndex> where, std::span<Texel> values,
              const Decode& decode) const;

  std::shared_ptr<const PlainImage> image_;
  TextureImage facts_;
  std::vector<float> decode_;  // Linear value of each stored number; empty for floats.
};

// The facts of an image by its header alone, without numbers.
TextureImage FactsOf(const PlainImage& image);

}  // namespace sheaf
