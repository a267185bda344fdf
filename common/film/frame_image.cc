// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/frame_image.h"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <numeric>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/base/digest.h"
#include "common/film/cryptomatte.h"
#include "common/film/denoised_output.h"

namespace sheaf {

static_assert(std::endian::native == std::endian::little,
              "the digest is over little-endian floats");

const std::vector<float>* FrameImage::Find(const std::string& channel) const {
  for (size_t i = 0; i < channel_names.size(); ++i) {
    if (channel_names[i] == channel) return &planes[i];
  }
  return nullptr;
}
std::vector<float>* FrameImage::Find(const std::string& channel) {
  return const_cast<std::vector<float>*>(static_cast<const FrameImage&>(*this).Find(channel));
}

size_t ImageChannelCount(const FilmOutputs& outputs) {
  return MakeFrameImage({0, 0, 1, 1}, 1, 1, outputs).channel_names.size();
}

FrameImage MakeFrameImage(PixelRect window, int32_t frame_width_px, int32_t frame_height_px,
                          const FilmOutputs& outputs, const ImageColor& color) {
  SHEAF_CHECK(!window.IsEmpty());
  FrameImage image;
  image.window = window;
  image.frame_width_px = frame_width_px;
  image.frame_height_px = frame_height_px;
  image.channel_names = {"R",        "G",        "B",        "A",        "albedo.R", "albedo.G",
                         "albedo.B", "normal.X", "normal.Y", "normal.Z", "depth.Z",  "samples",
                         "stderr.R", "stderr.G", "stderr.B", "nonfinite"};
  image.outputs = outputs;
  image.color = color;
  const std::vector<MeanChannel> means = MeanChannelsOf(outputs);
  const size_t first_guide = FirstGuideMean(outputs);
  for (size_t i = 0; i < means.size(); ++i) {
    const bool is_guide = i >= first_guide && i - first_guide < kGuideCount;
    if (!is_guide) image.channel_names.push_back(means[i].name);
  }
  for (size_t i = 0; i < kIdKindCount; ++i) {
    const auto kind = static_cast<IdKind>(i);
    if (outputs.HasIdNumber(kind)) image.channel_names.push_back(IdNumberChannel(kind));
    if (!outputs.HasCryptomatte(kind)) continue;
    for (std::string& name : CryptomatteChannels(kind)) {
      image.channel_names.push_back(std::move(name));
    }
  }
  if (HasDenoised(outputs)) {
    for (const char* layer : {kDenoisedLayer, kDenoisedErrorLayer}) {
      for (const char* component : {".R", ".G", ".B"}) {
        image.channel_names.push_back(absl::StrCat(layer, component));
      }
    }
  }
  image.planes.assign(image.channel_names.size(),
                      std::vector<float>(static_cast<size_t>(window.PixelCount())));
  return image;
}

void AddEyeDifference(FrameImage* image) {
  for (const char* component : {".R", ".G", ".B"}) {
    image->channel_names.push_back(absl::StrCat(kEyeDifferenceLayer, component));
    image->planes.emplace_back(static_cast<size_t>(image->window.PixelCount()));
  }
}

bool HasEyeDifference(const FrameImage& image) {
  return image.Find(absl::StrCat(kEyeDifferenceLayer, ".R")) != nullptr;
}

absl::Status ConvertColor(const Chromaticities& to, FrameImage* image) {
  const std::optional<Matrix4> conversion = RgbFromRgb(to, image->color.chromaticities);
  if (!conversion) return absl::InvalidArgumentError("the image's primaries are degenerate");
  const std::array<std::vector<float>*, 3> planes{image->Find("R"), image->Find("G"),
                                                  image->Find("B")};
  for (const std::vector<float>* plane : planes) {
    if (plane == nullptr) {
      return absl::InvalidArgumentError("the image has no channels R, G and B");
    }
  }
  image->color.chromaticities = to;
  if (*conversion == Matrix4()) return absl::OkStatus();
  for (size_t p = 0; p < planes[0]->size(); ++p) {
    const Vec3d rgb = TransformVector(
        *conversion, {static_cast<double>((*planes[0])[p]), static_cast<double>((*planes[1])[p]),
                      static_cast<double>((*planes[2])[p])});
    for (size_t i = 0; i < 3; ++i) (*planes[i])[p] = static_cast<float>(rgb[i]);
  }
  return absl::OkStatus();
}

std::string ImageDigest(const FrameImage& image) {
  Sha256 hash;
  hash.Update(absl::StrCat("window ", image.window.x0, " ", image.window.y0, " ", image.window.x1,
                           " ", image.window.y1, " frame ", image.frame_width_px, " ",
                           image.frame_height_px, "\n"));
  if (!(image.color.chromaticities == Chromaticities())) {
    const std::array<float, 8> stored = image.color.chromaticities.AsStored();
    hash.Update("chromaticities\n");
    hash.Update(stored.data(), sizeof(stored));
  }
  std::vector<size_t> by_name(image.channel_names.size());
  std::iota(by_name.begin(), by_name.end(), size_t{0});
  std::sort(by_name.begin(), by_name.end(),
            [&](size_t a, size_t b) { return image.channel_names[a] < image.channel_names[b]; });
  for (const size_t i : by_name) {
    hash.Update(absl::StrCat(image.channel_names[i], "\n"));
    hash.Update(image.planes[i].data(), image.planes[i].size() * sizeof(float));
  }
  return hash.FinishHex();
}

}  // namespace sheaf
