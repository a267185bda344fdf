// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to the reader of images, which textures and environment maps come through.
// The first byte selects the file's extension, by which OpenImageIO chooses its own reader.
#include "common/image/image_io.h"

#include <unistd.h>

#include <array>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/fuzz/fuzz_target.h"

namespace sheaf {
namespace {

constexpr std::array<const char*, 7> kExtensions{"exr", "png", "hdr", "pfm", "jpg", "tif", "tga"};

// A folder of this process that goes with it.
class Folder {
 public:
  Folder() : path_("/dev/shm/sheaf-image-fuzz-" + std::to_string(::getpid())) {
    std::filesystem::create_directory(path_);
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  const std::string& path() const { return path_; }

 private:
  const std::string path_;
};

}  // namespace

SHEAF_FUZZ_TARGET(image) {
  // A file that its own reader refuses goes to all others, among them those of cameras, which take
  // ten times as long as the rest. OpenImageIO is loaded by the first image.
  static const int own_reader_only = ::setenv("OPENIMAGEIO_OPTIONS", "try_all_readers=0", 1);
  SHEAF_CHECK(own_reader_only == 0);
  static const Folder folder;
  const char* const extension = kExtensions[testing::TakeByte(&bytes) % kExtensions.size()];
  const std::string path = folder.path() + "/a." + extension;
  std::ofstream(path, std::ios::binary) << bytes;
  ReadImageLimits limits;
  limits.memory_bytes_max = uint64_t{1} << 20;  // Cleared before a file turns out to be short.
  const absl::StatusOr<FloatImage> image = ReadImage(path, limits);
  if (!image.ok()) return;
  SHEAF_CHECK(image->width > 0 && image->height > 0 && image->channels > 0);
  SHEAF_CHECK(image->pixels.size() == static_cast<size_t>(image->width) *
                                          static_cast<size_t>(image->height) *
                                          static_cast<size_t>(image->channels));
}

}  // namespace sheaf
