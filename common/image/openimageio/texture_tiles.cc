// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/image/openimageio/texture_tiles.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <new>
#include <vector>

#include <OpenImageIO/half.h>
#include <OpenImageIO/imagecache.h>

#include "absl/strings/str_cat.h"
#include "common/image/image_limits.h"
#include "common/image/openimageio/image_layout.h"
#include "common/image/openimageio/plain_names.h"
#include "common/image/openimageio/read_image.h"
#include "common/image/texel_encoding.h"

namespace sheaf {
namespace {

constexpr int kTileSize = 64;  // Tile size for images whose files are not tiled.
constexpr int kBandHeight = 64;
constexpr double kBytesPerMegabyte = 1024.0 * 1024.0;

struct OpenedImage {
  std::string path;
  TexelEncoding encoding;
  TextureImage facts;
  ImageLayout layout;
  OIIO::ImageCache::ImageHandle* handle = nullptr;
  int stored_channels = 0;
  std::vector<float> decode;  // Linear value of each stored integer of 8 or 16 bits.
  mutable std::atomic<bool> failure_logged = false;
};

// One channel of a stored pixel as a linear value.
float DecodeChannel(const OpenedImage& image, OIIO::TypeDesc format, const void* pixels,
                    size_t at) {
  switch (format.basetype) {
    case OIIO::TypeDesc::UINT8:
      return image.decode[static_cast<const uint8_t*>(pixels)[at]];
    case OIIO::TypeDesc::UINT16:
      return image.decode[static_cast<const uint16_t*>(pixels)[at]];
    case OIIO::TypeDesc::HALF:
      return static_cast<float>(static_cast<const half*>(pixels)[at]);
    default: {
      // The cache keeps all other types as floats.
      const float value = static_cast<const float*>(pixels)[at];
      return image.layout.is_integer ? DecodeTexel(value, image.encoding) : value;
    }
  }
}

std::string CacheError(OIIO::ImageCache& cache) {
  return OneLine(cache.geterror(), "the file is cut short or damaged");
}

// Holds the last accessed tile, which serves most neighboring texels too.
class TileCursor {
 public:
  TileCursor(OIIO::ImageCache& cache, OIIO::ImageCache::Perthread* thread, const OpenedImage& image)
      : cache_(cache), thread_(thread), image_(image) {}
  ~TileCursor() { Release(); }
  TileCursor(const TileCursor&) = delete;
  TileCursor& operator=(const TileCursor&) = delete;

  // False if the tile cannot be read.
  bool Read(TexelIndex where, Texel& texel) {
    texel = {};
    const ImageLayout& layout = image_.layout;
    if (!layout.Stores(where.x, where.y)) return true;
    const int x = where.x + layout.origin_x, y = where.y + layout.origin_y;
    if (tile_ == nullptr || !roi_.contains(x, y)) {
      Release();
      tile_ = cache_.get_tile(image_.handle, thread_, 0, 0, x, y, 0);
      if (tile_ == nullptr) return false;
      roi_ = cache_.tile_roi(tile_);
      pixels_ = cache_.tile_pixels(tile_, format_);
      if (pixels_ == nullptr) return false;
    }
    const size_t pixel = static_cast<size_t>(y - roi_.ybegin) * static_cast<size_t>(roi_.width()) +
                         static_cast<size_t>(x - roi_.xbegin);
    const size_t begin = pixel * static_cast<size_t>(roi_.nchannels());
    for (size_t c = 0; c < static_cast<size_t>(image_.facts.channels); ++c) {
      const size_t place = begin + static_cast<size_t>(layout.place[c]);
      const float value = DecodeChannel(image_, format_, pixels_, place);
      texel[c] = std::isfinite(value) ? value : 0;
    }
    return true;
  }

 private:
  void Release() {
    if (tile_ != nullptr) cache_.release_tile(tile_);
    tile_ = nullptr;
  }

  OIIO::ImageCache& cache_;
  OIIO::ImageCache::Perthread* thread_;
  const OpenedImage& image_;
  OIIO::ImageCache::Tile* tile_ = nullptr;
  OIIO::ROI roi_;
  OIIO::TypeDesc format_;
  const void* pixels_ = nullptr;
};

class OpenImageIOTiles final : public TextureTiles {
 public:
  OpenImageIOTiles(uint64_t bytes_max, void (*log_error)(std::string_view));
  ~OpenImageIOTiles() override { OIIO::ImageCache::destroy(cache_); }
  OpenImageIOTiles(const OpenImageIOTiles&) = delete;
  OpenImageIOTiles& operator=(const OpenImageIOTiles&) = delete;

  absl::StatusOr<TextureImage> Open(const std::string& path, TexelEncoding encoding) override;
  void ReadTexels(int32_t image, std::span<const TexelIndex> where,
                  std::span<Texel> values) const override;
  uint64_t memory_bytes() const override;

 private:
  // The library's record of the calling thread, looked up once per thread and cache.
  OIIO::ImageCache::Perthread* ThreadRecord() const {
    struct Cached {
      uint64_t id = 0;
      OIIO::ImageCache::Perthread* record = nullptr;
    };
    thread_local Cached cached;
    if (cached.id != id_) cached = {id_, cache_->get_perthread_info()};
    return cached.record;
  }
  absl::Status Scan(OpenedImage& image) const;

  const bool opens_by_header_;
  void (*log_error_)(std::string_view);
  OIIO::ImageCache* cache_ = nullptr;
  uint64_t id_ = 0;  // Never reused in a process: names the cache in thread-local storage.
  std::vector<std::unique_ptr<OpenedImage>> images_;
  PlainNames names_;
};

// Reads every texel, to find damage, to count non-finite ones, and to drop an alpha that is 1
// everywhere, as pbrt-v4 does.
absl::Status OpenImageIOTiles::Scan(OpenedImage& image) const {
  const ImageLayout& layout = image.layout;
  const int x_begin = layout.origin_x + layout.x0, x_end = layout.origin_x + layout.x1;
  const auto stored_channels = static_cast<size_t>(image.stored_channels);
  const auto channels = static_cast<size_t>(layout.channels);
  std::vector<float> band(static_cast<size_t>(layout.x1 - layout.x0) *
                          static_cast<size_t>(std::min(kBandHeight, layout.y1 - layout.y0)) *
                          stored_channels);
  bool is_opaque = layout.StoresAll();
  for (int y = layout.y0; y < layout.y1; y += kBandHeight) {
    const int rows = std::min(kBandHeight, layout.y1 - y);
    const int y0 = layout.origin_y + y;
    if (!cache_->get_pixels(image.handle, ThreadRecord(), 0, 0, x_begin, x_end, y0, y0 + rows, 0, 1,
                            OIIO::TypeDesc::FLOAT, band.data())) {
      return absl::InvalidArgumentError(
          absl::StrCat(image.path, ": cannot be decoded: ", CacheError(*cache_)));
    }
    const size_t texels = static_cast<size_t>(x_end - x_begin) * static_cast<size_t>(rows);
    for (size_t i = 0; i < texels; ++i) {
      const float* texel = &band[i * stored_channels];
      bool finite = true;
      for (size_t c = 0; c < channels; ++c) finite &= std::isfinite(texel[layout.place[c]]);
      if (!finite) ++image.facts.non_finite_texels;
      is_opaque = is_opaque && (channels < 4 || texel[layout.place[3]] == 1);
    }
  }
  if (is_opaque) image.facts.channels = std::min(image.facts.channels, 3);
  return absl::OkStatus();
}

OpenImageIOTiles::OpenImageIOTiles(uint64_t bytes_max, void (*log_error)(std::string_view))
    : opens_by_header_(bytes_max == 0), log_error_(log_error) {
  static std::atomic<uint64_t> next_id = 1;
  id_ = next_id++;
  cache_ = OIIO::ImageCache::create(false);
  const double megabytes = std::max(static_cast<double>(bytes_max) / kBytesPerMegabyte, 0.25);
  cache_->attribute("max_memory_MB", static_cast<float>(megabytes));
  cache_->attribute("autotile", kTileSize);
  cache_->attribute("automip", 0);
  cache_->attribute("unassociatedalpha", 1);
}

absl::StatusOr<TextureImage> OpenImageIOTiles::Open(const std::string& path,
                                                    TexelEncoding encoding) {
  for (const auto& image : images_) {
    if (image->path == path && image->encoding.kind == encoding.kind &&
        image->encoding.gamma == encoding.gamma) {
      return image->facts;
    }
  }
  auto image = std::make_unique<OpenedImage>();
  image->path = path;
  image->encoding = encoding;
  try {
    // The cache takes memory by the size of an image, which is therefore checked before.
    const absl::StatusOr<std::unique_ptr<OIIO::ImageInput>> input = OpenInput(path);
    if (!input.ok()) return input.status();
    const OIIO::ImageSpec spec = (*input)->spec();
    absl::StatusOr<ImageLayout> layout =
        LayoutOf(path, (*input)->format_name(), spec, kImageSideMax);
    if (!layout.ok()) return layout.status();
    image->layout = *std::move(layout);
    image->stored_channels = spec.nchannels;
    image->facts.width = image->layout.width;
    image->facts.height = image->layout.height;
    image->facts.channels = image->layout.channels;
    image->facts.chromaticities = image->layout.chromaticities;
    if (spec.format == OIIO::TypeDesc::UINT8 || spec.format == OIIO::TypeDesc::UINT16) {
      image->decode =
          TexelDecodeTable(encoding, spec.format == OIIO::TypeDesc::UINT8 ? 256 : 65536);
    }
    const absl::StatusOr<std::string> name = names_.Of(path);
    if (!name.ok()) return name.status();
    image->handle = cache_->get_image_handle(OIIO::ustring(*name), ThreadRecord());
    if (image->handle == nullptr) {
      return absl::InvalidArgumentError(
          absl::StrCat(path, ": not a readable image: ", CacheError(*cache_)));
    }
    if (absl::Status status = opens_by_header_ ? absl::OkStatus() : Scan(*image); !status.ok()) {
      return status;
    }
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError(
        absl::StrCat(path, ": there is no memory to decode the image"));
  } catch (const std::exception& error) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": cannot be decoded: ", error.what()));
  }
  image->facts.index = static_cast<int32_t>(images_.size());
  images_.push_back(std::move(image));
  return images_.back()->facts;
}

uint64_t OpenImageIOTiles::memory_bytes() const {
  int64_t bytes = 0;
  const bool is_known =
      cache_->getattribute("stat:cache_memory_used", OIIO::TypeDesc::INT64, &bytes);
  return is_known && bytes > 0 ? static_cast<uint64_t>(bytes) : 0;
}

void OpenImageIOTiles::ReadTexels(int32_t image_index, std::span<const TexelIndex> where,
                                  std::span<Texel> values) const {
  const OpenedImage& image = *images_[static_cast<size_t>(image_index)];
  TileCursor cursor(*cache_, ThreadRecord(), image);
  for (size_t i = 0; i < where.size(); ++i) {
    if (cursor.Read(where[i], values[i])) continue;
    values[i].fill(std::numeric_limits<float>::quiet_NaN());
    if (!image.failure_logged.exchange(true)) {
      log_error_(absl::StrCat(image.path, ": can no longer be read: ", CacheError(*cache_)));
    }
  }
}

}  // namespace

std::unique_ptr<TextureTiles> MakeOpenImageIOTiles(uint64_t bytes_max,
                                                   void (*log_error)(std::string_view)) {
  return std::make_unique<OpenImageIOTiles>(bytes_max, log_error);
}

}  // namespace sheaf
