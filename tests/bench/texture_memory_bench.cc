// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// texture_memory_bench [GIGABYTES] [LIMIT_MB]: opens a set of images that would fill GIGABYTES if
// they were decoded as a whole, reads texels throughout each of them with a texture cache of
// LIMIT_MB, and prints the growth of the process. The images are one large PNG under many names.
// Exits with 1 if the process ever grew by more than the limit plus the memory for decoding one
// image (kDecodingBytes), or if a texel was wrong.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <system_error>
#include <vector>

#include "common/image/image_io.h"
#include "common/image/texture_cache.h"
#include "tests/bench/measures.h"

namespace sheaf {
namespace {

constexpr int kSizePx = 8192;
constexpr double kImageBytes = 3.0 * kSizePx * kSizePx;
// A band of 64 rows as floats for the check, the same band as in the file, and the decoder.
constexpr double kDecodingBytes = 96e6;
constexpr int kBandsRead = 4;
constexpr int kTexelsPerBand = 64;

Rgb8 TexelAt(int x, int y) {
  return {static_cast<uint8_t>(x >> 5), static_cast<uint8_t>(y >> 5), 128};
}

absl::Status WriteFrameImage(const std::string& path) {
  std::vector<Rgb8> pixels(static_cast<size_t>(kSizePx) * kSizePx);
  for (int y = 0; y < kSizePx; ++y) {
    for (int x = 0; x < kSizePx; ++x) {
      pixels[static_cast<size_t>(y) * kSizePx + static_cast<size_t>(x)] = TexelAt(x, y);
    }
  }
  return WritePng(path, kSizePx, kSizePx, pixels);
}

// Reads texels of some bands of the image. Returns false if one differs from the written value.
bool ReadSome(const TextureCache& cache, int32_t image) {
  bool is_right = true;
  for (int band = 0; band < kBandsRead; ++band) {
    std::vector<TexelIndex> where;
    for (int i = 0; i < kTexelsPerBand; ++i) {
      where.push_back({(i * 127 + image * 31) % kSizePx,
                       (band * (kSizePx / kBandsRead) + image * 64 + i) % kSizePx});
    }
    std::vector<Texel> texels(where.size());
    cache.ReadTexels(image, where, texels);
    for (size_t i = 0; i < where.size(); ++i) {
      const Rgb8 written = TexelAt(where[i].x, where[i].y);
      is_right = is_right && texels[i][0] == static_cast<float>(written.r) / 255 &&
                 texels[i][1] == static_cast<float>(written.g) / 255;
    }
  }
  return is_right;
}

int Run(double gigabytes, double limit_mb) {
  std::string folder = (std::filesystem::temp_directory_path() / "texture_memory_XXXXXX").string();
  if (mkdtemp(folder.data()) == nullptr) return 2;
  const std::string image_path = folder + "/0.png";
  if (const auto status = WriteFrameImage(image_path); !status.ok()) {
    std::fprintf(stderr, "%s\n", status.ToString().c_str());
    return 2;
  }
  const int count = static_cast<int>(gigabytes * 1e9 / kImageBytes) + 1;
  TextureCache cache(static_cast<uint64_t>(limit_mb * 1024 * 1024));
  const double before = ResidentBytes();
  double largest = before;
  bool is_right = true;
  const double begin = ProcessCpuSeconds();
  std::error_code error;
  std::vector<int32_t> images;
  for (int i = 0; i < count && is_right; ++i) {
    const std::string path = folder + "/" + std::to_string(i + 1) + ".png";
    std::filesystem::create_hard_link(image_path, path, error);
    const auto image = cache.Open(path, {TexelEncoding::Kind::kLinear});
    if (!image.ok()) std::fprintf(stderr, "%s\n", image.status().ToString().c_str());
    is_right = image.ok();
    if (is_right) images.push_back(image->index);
    largest = std::max(largest, ResidentBytes());
  }
  const double opened = ProcessCpuSeconds();
  for (const int32_t image : images) {
    is_right = ReadSome(cache, image) && is_right;
    largest = std::max(largest, ResidentBytes());
  }
  const double grown = largest - before, allowed = limit_mb * 1048576 + kDecodingBytes;
  std::printf(
      "%d images, %.1f GB decoded: grew by %.0f MB (limit %.0f MB, allowed %.0f MB); opened in "
      "%.0f s, read in %.0f s of CPU; texels %s\n",
      count, count * kImageBytes * 1e-9, grown / 1048576, limit_mb, allowed / 1048576,
      opened - begin, ProcessCpuSeconds() - opened, is_right ? "right" : "WRONG");
  std::filesystem::remove_all(folder, error);
  return is_right && grown <= allowed ? 0 : 1;
}

}  // namespace
}  // namespace sheaf

int main(int argc, char** argv) {
  return sheaf::Run(argc > 1 ? std::atof(argv[1]) : 16, argc > 2 ? std::atof(argv[2]) : 256);
}
