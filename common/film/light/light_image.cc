// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/light/light_image.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"

namespace sheaf {
namespace {

constexpr std::array kColors = {"R", "G", "B"};

enum class Sum { kNone, kPlain, kQuadrature };

// How each channel of the image is added; in their order.
std::vector<Sum> SumsOf(const FrameImage& image) {
  std::vector<Sum> sums(image.channel_names.size(), Sum::kNone);
  const auto set = [&](const std::string& name, Sum sum) {
    const auto found = std::ranges::find(image.channel_names, name);
    SHEAF_CHECK(found != image.channel_names.end());
    sums[static_cast<size_t>(found - image.channel_names.begin())] = sum;
  };
  for (const char* component : kColors) {
    set(component, Sum::kPlain);
    set(std::string("stderr.") + component, Sum::kQuadrature);
    for (const std::string& group : image.outputs.light_groups) {
      set(group + "." + component, Sum::kPlain);
    }
  }
  set("nonfinite", Sum::kPlain);
  return sums;
}

// Whether the image has the channels of `first`, as its first ones.
bool StartsWith(const FrameImage& image, const FrameImage& first) {
  const std::vector<std::string>& names = image.channel_names;
  return names.size() >= first.channel_names.size() &&
         std::equal(first.channel_names.begin(), first.channel_names.end(), names.begin());
}

float Quadrature(float a, float b) {
  return static_cast<float>(std::sqrt(double{a} * double{a} + double{b} * double{b}));
}

}  // namespace

void AddLight(const FrameImage& camera, const FrameImage& light, const PixelRect& rect,
              FrameImage* image) {
  SHEAF_CHECK(camera.window == image->window && light.window == image->window &&
              image->window.Contains(rect));
  SHEAF_CHECK(camera.channel_names == light.channel_names && StartsWith(*image, camera));
  const std::vector<Sum> sums = SumsOf(camera);
  const auto width = static_cast<size_t>(rect.Width());
  for (size_t channel = 0; channel < sums.size(); ++channel) {
    for (int32_t y = rect.y0; y < rect.y1; ++y) {
      const size_t row = image->window.IndexOf(rect.x0, y);
      const float* a = camera.planes[channel].data() + row;
      const float* b = light.planes[channel].data() + row;
      float* out = image->planes[channel].data() + row;
      switch (sums[channel]) {
        case Sum::kNone:
          std::copy_n(a, width, out);
          break;
        case Sum::kPlain:
          for (size_t i = 0; i < width; ++i) out[i] = a[i] + b[i];
          break;
        case Sum::kQuadrature:
          for (size_t i = 0; i < width; ++i) out[i] = Quadrature(a[i], b[i]);
          break;
      }
    }
  }
}

std::string LightMeanChannel(const std::string& component) {
  return absl::StrCat(kLightLayerPrefix, "mean.", component);
}

std::string LightErrorChannel(const std::string& component) {
  return absl::StrCat(kLightLayerPrefix, "stderr.", component);
}

std::vector<LightLayerChannel> LightLayerChannels(const FilmOutputs& outputs) {
  std::vector<LightLayerChannel> channels;
  for (const char* component : kColors) {
    channels.push_back({component, LightMeanChannel(component)});
  }
  for (const char* component : kColors) {
    channels.push_back({absl::StrCat("stderr.", component), LightErrorChannel(component)});
  }
  for (const char* count : {"samples", "nonfinite"}) {
    channels.push_back({count, absl::StrCat(kLightLayerPrefix, count)});
  }
  for (const std::string& group : outputs.light_groups) {
    for (const char* component : kColors) {
      const std::string name = absl::StrCat(group, ".", component);
      channels.push_back({name, absl::StrCat(kLightLayerPrefix, "group.", name)});
    }
  }
  return channels;
}

void SetLightLayer(const FrameImage& light, FrameImage* image) {
  SHEAF_CHECK(light.window == image->window && StartsWith(*image, light));
  for (const auto& [of_image, of_layer] : LightLayerChannels(image->outputs)) {
    std::vector<float>* plane = image->Find(of_layer);
    if (plane == nullptr) {
      image->channel_names.push_back(of_layer);
      plane = &image->planes.emplace_back();
    }
    *plane = *light.Find(of_image);
  }
}

}  // namespace sheaf
