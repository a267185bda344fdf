// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The door to OpenImageIO, which is opened when the first image is read: the library brings two
// hundred others along, and a program that links it starts in half a second instead of twenty
// milliseconds and has 100 MB more (docs/adr/0041). What needs it is a module of its own
// (common/image/openimageio/), loaded at run time:
//
//     ReadImage, TextureCache::Open > LoadImageLibrary > libsheaf_openimageio.so > OpenImageIO
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

// What TextureCache does, once there is an image to do it with.
class TextureTiles {
 public:
  virtual ~TextureTiles() = default;
  virtual absl::StatusOr<TextureImage> Open(const std::string& path, TexelEncoding encoding) = 0;
  virtual void ReadTexels(int32_t image, std::span<const TexelIndex> where,
                          std::span<Texel> values) const = 0;
};

struct ImageLibrary {
  absl::StatusOr<FloatImage> (*read)(const std::string& path, const ReadImageLimits& limits);
  // log_error: who is told of tiles that can no longer be read.
  std::unique_ptr<TextureTiles> (*make_texture_tiles)(uint64_t bytes_max,
                                                      void (*log_error)(std::string_view));
};

inline constexpr char kImageLibraryFile[] = "libsheaf_openimageio.so";
// The module's one symbol, an ImageLibrary.
inline constexpr char kImageLibrarySymbol[] = "sheaf_image_library";

// The module of the program's own folder, or of ../lib/sheaf beside that where it is installed.
// Never unloaded. Errors: kFailedPrecondition where it is not there or does not fit.
// Thread safety: any number of threads.
absl::StatusOr<const ImageLibrary*> LoadImageLibrary();
// Of the first of the folders that has the file.
absl::StatusOr<const ImageLibrary*> LoadImageLibraryFrom(const std::vector<std::string>& folders);

}  // namespace sheaf
