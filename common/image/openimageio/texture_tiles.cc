// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/image/openimageio/texture_tiles.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <limits>
#include <new>
#include <system_error>
#include <vector>

#include <OpenImageIO/half.h>
#include <OpenImageIO/imagecache.h>

#include "absl/strings/str_cat.h"
#include "common/image/openimageio/read_image.h"
#include "common/math/elementary.h"

namespace sheaf {
namespace {

constexpr int kTileSize = 64;  // Tile size for images whose files are not tiled.
constexpr int kBandHeight = 64;
constexpr double kBytesPerMegabyte = 1024.0 * 1024.0;

struct OpenedImage {
  std::string path;
  TexelEncoding encoding;
  TextureImage facts;
  OIIO::ImageCache::ImageHandle* handle = nullptr;
  int origin_x = 0, origin_y = 0;
  int stored_channels = 0;
  std::vector<float> decode;  // Linear value of each stored integer; empty for floats.
  mutable std::atomic<bool> failure_logged = false;
};

std::vector<float> MakeDecodeTable(TexelEncoding encoding, bool is_8bit) {
  const size_t count = is_8bit ? 256 : 65536;
  std::vector<float> table(count);
  for (size_t i = 0; i < count; ++i) {
    const float encoded = static_cast<float>(i) / static_cast<float>(count - 1);
    const bool is_srgb = encoding.kind == TexelEncoding::Kind::kSrgb ||
                         (encoding.kind == TexelEncoding::Kind::kAuto && is_8bit);
    if (is_srgb) {
      table[i] = DecodeSrgb(encoded);
    } else if (encoding.kind == TexelEncoding::Kind::kGamma) {
      table[i] = Pow(encoded, encoding.gamma);
    } else {
      table[i] = encoded;
    }
  }
  return table;
}

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
    default:
      return static_cast<const float*>(pixels)[at];
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
    const int x = where.x + image_.origin_x, y = where.y + image_.origin_y;
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
    texel = {};
    for (int c = 0; c < image_.facts.channels; ++c) {
      const float value = DecodeChannel(image_, format_, pixels_, begin + static_cast<size_t>(c));
      texel[static_cast<size_t>(c)] = std::isfinite(value) ? value : 0;
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

absl::Status DescribeImage(const OIIO::ImageSpec& spec, const std::string& path,
                           OpenedImage& image) {
  if (spec.width <= 0 || spec.height <= 0 || spec.nchannels <= 0 || spec.depth > 1) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": not a flat image"));
  }
  image.facts.width = spec.width;
  image.facts.height = spec.height;
  // Gray with alpha counts as gray; channels beyond RGBA are other layers.
  image.facts.channels = spec.nchannels < 3 ? 1 : std::min(spec.nchannels, 4);
  image.origin_x = spec.x;
  image.origin_y = spec.y;
  image.stored_channels = spec.nchannels;
  return absl::OkStatus();
}

class OpenImageIOTiles final : public TextureTiles {
 public:
  OpenImageIOTiles(uint64_t bytes_max, void (*log_error)(std::string_view));
  ~OpenImageIOTiles() override { OIIO::ImageCache::destroy(cache_); }
  OpenImageIOTiles(const OpenImageIOTiles&) = delete;
  OpenImageIOTiles& operator=(const OpenImageIOTiles&) = delete;

  absl::StatusOr<TextureImage> Open(const std::string& path, TexelEncoding encoding) override;
  void ReadTexels(int32_t image, std::span<const TexelIndex> where,
                  std::span<Texel> values) const override;

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

  void (*log_error_)(std::string_view);
  OIIO::ImageCache* cache_ = nullptr;
  uint64_t id_ = 0;  // Never reused in a process: names the cache in thread-local storage.
  std::vector<std::unique_ptr<OpenedImage>> images_;
};

// Reads every texel, to find damage and to count non-finite ones.
absl::Status OpenImageIOTiles::Scan(OpenedImage& image) const {
  const int width = image.facts.width, height = image.facts.height;
  std::vector<float> band(static_cast<size_t>(width) * kBandHeight *
                          static_cast<size_t>(image.stored_channels));
  for (int y = 0; y < height; y += kBandHeight) {
    const int rows = std::min(kBandHeight, height - y);
    const int y0 = image.origin_y + y;
    if (!cache_->get_pixels(image.handle, ThreadRecord(), 0, 0, image.origin_x,
                            image.origin_x + width, y0, y0 + rows, 0, 1, OIIO::TypeDesc::FLOAT,
                            band.data())) {
      return absl::InvalidArgumentError(
          absl::StrCat(image.path, ": cannot be decoded: ", CacheError(*cache_)));
    }
    const size_t texels = static_cast<size_t>(width) * static_cast<size_t>(rows);
    for (size_t i = 0; i < texels; ++i) {
      const float* texel = &band[i * static_cast<size_t>(image.stored_channels)];
      const bool finite = std::all_of(texel, texel + image.facts.channels,
                                      [](float value) { return std::isfinite(value); });
      if (!finite) ++image.facts.non_finite_texels;
    }
  }
  return absl::OkStatus();
}

OpenImageIOTiles::OpenImageIOTiles(uint64_t bytes_max, void (*log_error)(std::string_view))
    : log_error_(log_error) {
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
  std::error_code code;
  if (!std::filesystem::is_regular_file(path, code)) {
    return absl::NotFoundError(absl::StrCat(path, ": no such file"));
  }
  auto image = std::make_unique<OpenedImage>();
  image->path = path;
  image->encoding = encoding;
  OIIO::ImageCache& cache = *cache_;
  try {
    image->handle = cache.get_image_handle(OIIO::ustring(path), ThreadRecord());
    OIIO::ImageSpec spec;
    if (image->handle == nullptr ||
        !cache.get_imagespec(image->handle, ThreadRecord(), spec, 0, 0, true)) {
      return absl::InvalidArgumentError(
          absl::StrCat(path, ": not a readable image: ", CacheError(cache)));
    }
    if (absl::Status status = DescribeImage(spec, path, *image); !status.ok()) return status;
    if (spec.format == OIIO::TypeDesc::UINT8 || spec.format == OIIO::TypeDesc::UINT16) {
      image->decode = MakeDecodeTable(encoding, spec.format == OIIO::TypeDesc::UINT8);
    }
    if (absl::Status status = Scan(*image); !status.ok()) return status;
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
