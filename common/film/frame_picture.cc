// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/frame_picture.h"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <numeric>
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
                              const FilmOutputs& outputs) {
  SHEAF_CHECK(window.x0 < window.x1 && window.y0 < window.y1);
  FramePicture picture;
  picture.window = window;
  picture.frame_width_px = frame_width_px;
  picture.frame_height_px = frame_height_px;
  picture.channel_names = {"R",        "G",        "B",        "A",        "albedo.R", "albedo.G",
                           "albedo.B", "normal.X", "normal.Y", "normal.Z", "depth.Z",  "samples",
                           "stderr.R", "stderr.G", "stderr.B", "nonfinite"};
  picture.outputs = outputs;
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

std::string PictureDigest(const FramePicture& picture) {
  Sha256 hash;
  hash.Update(absl::StrCat("window ", picture.window.x0, " ", picture.window.y0, " ",
                           picture.window.x1, " ", picture.window.y1, " frame ",
                           picture.frame_width_px, " ", picture.frame_height_px, "\n"));
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
