// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/frame_picture.h"

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

namespace sheaf {

static_assert(std::endian::native == std::endian::little,
              "the digest is over little-endian floats");

const std::vector<float>* FramePicture::Find(const std::string& channel) const {
  for (size_t i = 0; i < channel_names.size(); ++i) {
    if (channel_names[i] == channel) return &planes[i];
  }
  return nullptr;
}
std::vector<float>* FramePicture::Find(const std::string& channel) {
  return const_cast<std::vector<float>*>(static_cast<const FramePicture&>(*this).Find(channel));
}

size_t PictureChannelCount(const FilmOutputs& outputs) {
  return MakeFramePicture({0, 0, 1, 1}, 1, 1, outputs).channel_names.size();
}

FramePicture MakeFramePicture(PixelRect window, int32_t frame_width_px, int32_t frame_height_px,
                              const FilmOutputs& outputs, const PictureColor& color) {
  SHEAF_CHECK(!window.IsEmpty());
  FramePicture picture;
  picture.window = window;
  picture.frame_width_px = frame_width_px;
  picture.frame_height_px = frame_height_px;
  picture.channel_names = {"R",        "G",        "B",        "A",        "albedo.R", "albedo.G",
                           "albedo.B", "normal.X", "normal.Y", "normal.Z", "depth.Z",  "samples",
                           "stderr.R", "stderr.G", "stderr.B", "nonfinite"};
  picture.outputs = outputs;
  picture.color = color;
  for (const MeanChannel& channel : MeanChannelsOf(outputs)) {
    picture.channel_names.push_back(channel.name);
  }
  for (size_t i = 0; i < kIdKindCount; ++i) {
    const auto kind = static_cast<IdKind>(i);
    if (outputs.HasIdNumber(kind)) picture.channel_names.push_back(IdNumberChannel(kind));
    if (!outputs.HasCryptomatte(kind)) continue;
    for (std::string& name : CryptomatteChannels(kind)) {
      picture.channel_names.push_back(std::move(name));
    }
  }
  picture.planes.assign(picture.channel_names.size(),
                        std::vector<float>(static_cast<size_t>(window.PixelCount())));
  return picture;
}

absl::Status ConvertColor(const Chromaticities& to, FramePicture* picture) {
  const std::optional<Matrix4> conversion = RgbFromRgb(to, picture->color.chromaticities);
  if (!conversion) return absl::InvalidArgumentError("the image's primaries are degenerate");
  const std::array<std::vector<float>*, 3> planes{picture->Find("R"), picture->Find("G"),
                                                  picture->Find("B")};
  for (const std::vector<float>* plane : planes) {
    if (plane == nullptr) {
      return absl::InvalidArgumentError("the image has no channels R, G and B");
    }
  }
  picture->color.chromaticities = to;
  if (*conversion == Matrix4()) return absl::OkStatus();
  for (size_t p = 0; p < planes[0]->size(); ++p) {
    const Vec3d rgb = TransformVector(
        *conversion, {static_cast<double>((*planes[0])[p]), static_cast<double>((*planes[1])[p]),
                      static_cast<double>((*planes[2])[p])});
    for (size_t i = 0; i < 3; ++i) (*planes[i])[p] = static_cast<float>(rgb[i]);
  }
  return absl::OkStatus();
}

std::string PictureDigest(const FramePicture& picture) {
  Sha256 hash;
  hash.Update(absl::StrCat("window ", picture.window.x0, " ", picture.window.y0, " ",
                           picture.window.x1, " ", picture.window.y1, " frame ",
                           picture.frame_width_px, " ", picture.frame_height_px, "\n"));
  if (!(picture.color.chromaticities == Chromaticities())) {
    const std::array<float, 8> stored = picture.color.chromaticities.AsStored();
    hash.Update("chromaticities\n");
    hash.Update(stored.data(), sizeof(stored));
  }
  std::vector<size_t> by_name(picture.channel_names.size());
  std::iota(by_name.begin(), by_name.end(), size_t{0});
  std::sort(by_name.begin(), by_name.end(), [&](size_t a, size_t b) {
    return picture.channel_names[a] < picture.channel_names[b];
  });
  for (const size_t i : by_name) {
    hash.Update(absl::StrCat(picture.channel_names[i], "\n"));
    hash.Update(picture.planes[i].data(), picture.planes[i].size() * sizeof(float));
  }
  return hash.FinishHex();
}

}  // namespace sheaf
