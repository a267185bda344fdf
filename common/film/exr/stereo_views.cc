// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/exr/stereo_views.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <map>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/film/exr/exr_channels.h"

namespace sheaf {
namespace {

constexpr std::string_view kDefaultViewChannels[] = {"R", "G", "B", "A"};

// The left or right half of each line.
std::vector<float> HalfOf(const std::vector<float>& plane, size_t width, size_t view) {
  const size_t half = width / 2;
  std::vector<float> result;
  result.reserve(plane.size() / 2);
  for (size_t line = 0; line < plane.size(); line += width) {
    const auto begin = plane.begin() + static_cast<std::ptrdiff_t>(line + view * half);
    result.insert(result.end(), begin, begin + static_cast<std::ptrdiff_t>(half));
  }
  return result;
}

std::vector<float> SideBySide(const std::vector<float>& left, const std::vector<float>& right,
                              size_t width) {
  std::vector<float> result;
  result.reserve(2 * left.size());
  for (size_t line = 0; line < left.size(); line += width) {
    for (const std::vector<float>* view : {&left, &right}) {
      const auto begin = view->begin() + static_cast<std::ptrdiff_t>(line);
      result.insert(result.end(), begin, begin + static_cast<std::ptrdiff_t>(width));
    }
  }
  return result;
}

}  // namespace

bool IsStereoImage(const FrameImage& image) {
  const auto views = image.metadata.find(kViewsKey);
  return views != image.metadata.end() && views->second == kStereoViews;
}

std::string ViewChannelName(const std::string& file_name, size_t view) {
  const bool is_bare =
      std::ranges::find(kDefaultViewChannels, file_name) != std::end(kDefaultViewChannels);
  if (is_bare && view == 0) return file_name;
  const size_t dot = file_name.rfind('.');
  if (dot == std::string::npos) return absl::StrCat(kViewNames[view], ".", file_name);
  return absl::StrCat(file_name.substr(0, dot), ".", kViewNames[view], file_name.substr(dot));
}

std::optional<std::pair<size_t, std::string>> ChannelOfView(const std::string& file_name) {
  if (std::ranges::find(kDefaultViewChannels, file_name) != std::end(kDefaultViewChannels)) {
    return std::pair{size_t{0}, file_name};
  }
  const size_t dot = file_name.rfind('.');
  if (dot == std::string::npos) return std::nullopt;
  const std::string layer = file_name.substr(0, dot);
  for (size_t view = 0; view < std::size(kViewNames); ++view) {
    if (layer == kViewNames[view]) return std::pair{view, file_name.substr(dot + 1)};
    const std::string end = absl::StrCat(".", kViewNames[view]);
    if (!layer.ends_with(end)) continue;
    const std::string name =
        absl::StrCat(layer.substr(0, layer.size() - end.size()), file_name.substr(dot));
    return std::pair{view, ImageChannelName(name)};
  }
  return std::nullopt;
}

bool IsOfNoView(std::string_view name) {
  return name.substr(0, name.rfind('.')) == kEyeDifferenceLayer;
}

std::string_view WithoutView(std::string_view layer) {
  for (const char* view : kViewNames) {
    const std::string end = absl::StrCat(".", view);
    if (layer.ends_with(end)) return layer.substr(0, layer.size() - end.size());
  }
  return layer;
}

FrameImage SplitViews(const FrameImage& image) {
  FrameImage split = image;
  split.channel_names.clear();
  split.planes.clear();
  split.window.x1 = image.window.x0 + image.window.Width() / 2;
  split.frame_width_px = image.frame_width_px / 2;
  for (size_t i = 0; i < image.planes.size(); ++i) {
    if (IsOfNoView(image.channel_names[i])) {
      split.channel_names.push_back(image.channel_names[i]);
      split.planes.push_back(HalfOf(image.planes[i], static_cast<size_t>(image.window.Width()), 0));
      continue;
    }
    for (size_t view = 0; view < std::size(kViewNames); ++view) {
      split.channel_names.push_back(ViewChannelName(FileChannelName(image.channel_names[i]), view));
      split.planes.push_back(
          HalfOf(image.planes[i], static_cast<size_t>(image.window.Width()), view));
    }
  }
  return split;
}

void JoinViews(FrameImage* image) {
  if (!IsStereoImage(*image)) return;
  constexpr size_t kAbsent = ~size_t{0};
  std::map<std::string, std::array<size_t, 2>> channels;
  for (size_t i = 0; i < image->channel_names.size(); ++i) {
    if (IsOfNoView(image->channel_names[i])) {
      channels[image->channel_names[i]] = {i, i};
      continue;
    }
    const auto channel = ChannelOfView(image->channel_names[i]);
    if (!channel) return;
    auto& views = channels.try_emplace(channel->second, std::array{kAbsent, kAbsent}).first->second;
    views[channel->first] = i;
  }
  std::vector<std::string> names;
  std::vector<std::vector<float>> planes;
  const auto width = static_cast<size_t>(image->window.Width());
  for (const auto& [name, views] : channels) {
    if (views[0] == kAbsent || views[1] == kAbsent) return;
    names.push_back(name);
    planes.push_back(SideBySide(image->planes[views[0]], image->planes[views[1]], width));
  }
  image->channel_names = std::move(names);
  image->planes = std::move(planes);
  image->window.x1 += image->window.Width();
  image->frame_width_px *= 2;
}

}  // namespace sheaf
