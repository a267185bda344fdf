// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TextureCache: texels of any number of images of any size within a fixed amount of memory. Small
// images are read once and stay in memory (resident_texture.h), up to a quarter of it. All others
// are divided into tiles that are read when accessed and dropped when memory is needed; the value
// of a texel never depends on the contents of the cache. Wraps OpenImageIO's image cache, on which
// its texture system is built; filtering is left to the caller so that texels are decoded before
// they are averaged. The first image of tiles loads that library (image_library.h).
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "absl/status/statusor.h"
#include "common/image/texel_encoding.h"

namespace sheaf {

struct TextureImage {
  int32_t index = -1;         // For ReadTexels.
  int width = 0, height = 0;  // In EXR of the display window; what is not stored of it is 0.
  // 1 (gray), 3 (RGB) or 4 (RGBA), by the names of the file's channels; 3 where alpha is 1
  // everywhere.
  int channels = 0;
  uint64_t non_finite_texels = 0;  // Texels with a NaN or infinity; those channels read as 0.
  // The primaries of the texels, if the file gives them: red, green, blue, white; x before y.
  std::optional<std::array<float, 8>> chromaticities;
};

// Row 0 is the top of the image.
struct TexelIndex {
  int x = 0, y = 0;
};
using Texel = std::array<float, 4>;  // Linear; channels the image lacks are 0.

class ResidentTexture;
class TextureTiles;
struct PlainImage;

// The largest image that stays in memory, in bytes of its numbers.
inline constexpr uint64_t kResidentImageBytesMax = uint64_t{1} << 26;

class TextureCache {
 public:
  // bytes_max: limit of the images and tiles in memory. Beyond it every thread keeps at most two
  // tiles in use.
  // 0: images are opened by their headers alone, to check a scene.
  explicit TextureCache(uint64_t bytes_max);
  ~TextureCache();
  TextureCache(const TextureCache&) = delete;
  TextureCache& operator=(const TextureCache&) = delete;

  // Reads the whole image once, in bands, so that damage and non-finite texels are found here and
  // not during rendering; by its header alone, it keeps an alpha that is 1 everywhere. The same
  // path and encoding give the same image. Errors: kNotFound; kInvalidArgument as for ReadImage, in
  // messages that begin with the path; those of LoadImageLibrary. Thread safety: none; open
  // everything before reading.
  absl::StatusOr<TextureImage> Open(const std::string& path, TexelEncoding encoding);

  bool opens_by_header() const { return bytes_max_ == 0; }
  // The memory of images and tiles now. Thread safety: as ReadTexels.
  uint64_t memory_bytes() const;

  // values[i] becomes the texel at where[i]. A tile that can no longer be read (the file was
  // changed or removed while in use) gives NaN, which the film counts and reports, and is logged
  // once per image.
  // Requires: image was returned by Open; every index is within the image; spans have the same
  // size.
  // Thread safety: any number of threads at once.
  void ReadTexels(int32_t image, std::span<const TexelIndex> where, std::span<Texel> values) const;

 private:
  struct Opened {
    std::string path;
    TexelEncoding encoding;
    TextureImage facts;
    std::unique_ptr<const ResidentTexture> resident;
    int32_t tiled = -1;  // Without `resident`: the image's number among those of tiles_.
  };
  // The numbers of the file, if they may stay in memory; else null.
  std::shared_ptr<const PlainImage> Load(const std::string& path);
  absl::Status OpenTiles(Opened* opened);

  const uint64_t bytes_max_;
  std::vector<Opened> opened_;  // By TextureImage::index.
  uint64_t resident_bytes_ = 0;
  // By path: images of other encodings share them.
  absl::flat_hash_map<std::string, std::shared_ptr<const PlainImage>> numbers_;
  std::unique_ptr<TextureTiles> tiles_;  // Set when the first image of tiles is opened.
};

}  // namespace sheaf
