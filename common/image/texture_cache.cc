// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/image/texture_cache.h"

#include "common/base/log.h"
#include "common/image/image_header.h"
#include "common/image/image_library.h"

namespace sheaf {

TextureCache::TextureCache(uint64_t bytes_max) : bytes_max_(bytes_max) {}

TextureCache::~TextureCache() = default;

absl::StatusOr<TextureImage> TextureCache::Open(const std::string& path, TexelEncoding encoding) {
  if (absl::Status header = CheckImageHeader(path); !header.ok()) return header;
  if (tiles_ == nullptr) {
    const absl::StatusOr<const ImageLibrary*> library = LoadImageLibrary();
    if (!library.ok()) return library.status();
    tiles_ = (*library)->make_texture_tiles(bytes_max_, LogError);
  }
  return tiles_->Open(path, encoding);
}

void TextureCache::ReadTexels(int32_t image, std::span<const TexelIndex> where,
                              std::span<Texel> values) const {
  tiles_->ReadTexels(image, where, values);
}

}  // namespace sheaf
