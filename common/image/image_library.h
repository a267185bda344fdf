// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Loads the module that uses OpenImageIO when it is needed. The library depends on two hundred
// others: a program linked with it starts in half a second instead of twenty milliseconds and needs
// 100 MB more (docs/adr/0041). So the code that uses it is a separate module
// (common/image/openimageio/), loaded at run time for images that ReadPlainImage does not take:
//
//     ReadImage, TextureCache::Open > ReadPlainImage
//                                   > LoadImageLibrary > libsheaf_openimageio.so > OpenImageIO
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "common/image/image_io.h"
#include "common/image/texture_cache.h"

namespace sheaf {

// The implementation of TextureCache, loaded with the first image.
class TextureTiles {
 public:
  virtual ~TextureTiles() = default;
  virtual absl::StatusOr<TextureImage> Open(const std::string& path, TexelEncoding encoding) = 0;
  virtual void ReadTexels(int32_t image, std::span<const TexelIndex> where,
                          std::span<Texel> values) const = 0;
  // The memory of its tiles now.
  virtual uint64_t memory_bytes() const = 0;
};

struct ImageLibrary {
  absl::StatusOr<FloatImage> (*read)(const std::string& path, const ReadImageLimits& limits);
  // log_error: called for tiles that can no longer be read.
  std::unique_ptr<TextureTiles> (*make_texture_tiles)(uint64_t bytes_max,
                                                      void (*log_error)(std::string_view));
};

inline constexpr char kImageLibraryFile[] = "libsheaf_openimageio.so";
// The module's only symbol, an ImageLibrary.
inline constexpr char kImageLibrarySymbol[] = "sheaf_image_library";

// Loads the module from ModuleFolders(). Never unloaded.
// Errors: kFailedPrecondition if it is missing or incompatible.
// Thread safety: any number of threads.
absl::StatusOr<const ImageLibrary*> LoadImageLibrary();
// Loads it from the first of the folders that has the file.
absl::StatusOr<const ImageLibrary*> LoadImageLibraryFrom(const std::vector<std::string>& folders);

}  // namespace sheaf
