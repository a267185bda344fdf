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
#include "common/film/task_kind.h"

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

// The squared bias of merging, estimated about a pixel. Single pixels are too noisy: the mean over
// the pixels next to it of the product of two independent estimates has the mean of their squared
// biases as its expectation, where the square of one would include its noise. A wide neighborhood
// has little noise, but hides the bias of a peak that is narrower. So a narrow one counts where it
// has more bias, by more than its noise.
class SquaredBias {
 public:
  // component: "R", "G" or "B". The image must outlive it.
  SquaredBias(const FrameImage& light, const std::string& component)
      : window_(light.window),
        passes_(light.Find("samples")),
        all_(light.Find(MergeBiasChannel(component))),
        even_(light.Find(EvenMergeBiasChannel(component))) {}

  // Whether the image has an estimate.
  bool present() const { return all_ != nullptr && even_ != nullptr; }
  double At(int32_t x, int32_t y) const {
    constexpr int32_t kWideReach = 3, kNarrowReach = 1;
    const Near wide = Around(x, y, kWideReach), narrow = Around(x, y, kNarrowReach);
    return std::max({0.0, wide.product, narrow.product - narrow.NoiseOfProduct()});
  }

 private:
  // Two estimates of the bias of a pixel: by the passes of even replicates, and by the others.
  struct Halves {
    double even = 0, odd = 0;
  };
  // Means over the pixels near one.
  struct Near {
    double product = 0;
    double square_of_difference = 0;
    int count = 0;

    // The standard error of `product` where there is no bias, and pixels are independent: that of
    // one pixel is the variance of a half, of which the difference has twice.
    double NoiseOfProduct() const { return square_of_difference / (2 * std::sqrt(count)); }
  };

  Near Around(int32_t x, int32_t y, int32_t reach) const {
    Near near;
    for (int32_t v = std::max(y - reach, window_.y0); v <= std::min(y + reach, window_.y1 - 1);
         ++v) {
      const int32_t first = std::max(x - reach, window_.x0);
      size_t p = window_.IndexOf(first, v);
      for (int32_t u = first; u <= std::min(x + reach, window_.x1 - 1); ++u, ++p) {
        const Halves halves = HalvesAt(p);
        const double difference = halves.even - halves.odd;
        near.product += halves.even * halves.odd;
        near.square_of_difference += difference * difference;
        ++near.count;
      }
    }
    near.product /= near.count;
    near.square_of_difference /= near.count;
    return near;
  }
  Halves HalvesAt(size_t p) const {
    const double passes = std::floor(double{(*passes_)[p]} + 0.5);
    const double odd_passes = std::floor(passes / 2), even_passes = passes - odd_passes;
    if (odd_passes == 0) return {};
    const double even = double{(*even_)[p]}, odd = double{(*all_)[p]} - even;
    return {even * (passes / even_passes), odd * (passes / odd_passes)};
  }

  const PixelRect window_;
  const std::vector<float>* passes_;
  const std::vector<float>* all_;
  const std::vector<float>* even_;
};

void AddBias(const FrameImage& light, const PixelRect& rect, FrameImage* image) {
  for (const char* component : kColors) {
    const SquaredBias bias(light, component);
    if (!bias.present()) return;
    std::vector<float>& error = *image->Find(std::string("stderr.") + component);
    for (int32_t y = rect.y0; y < rect.y1; ++y) {
      size_t p = image->window.IndexOf(rect.x0, y);
      for (int32_t x = rect.x0; x < rect.x1; ++x, ++p) {
        error[p] =
            static_cast<float>(std::sqrt(double{error[p]} * double{error[p]} + bias.At(x, y)));
      }
    }
  }
}

float Quadrature(float a, float b) {
  return static_cast<float>(std::sqrt(double{a} * double{a} + double{b} * double{b}));
}

}  // namespace

void AddLight(const FrameImage& camera, const FrameImage& light, const PixelRect& rect,
              FrameImage* image) {
  SHEAF_CHECK(camera.window == image->window && light.window == image->window &&
              image->window.Contains(rect));
  SHEAF_CHECK(StartsWith(*image, camera));
  const std::vector<Sum> sums = SumsOf(camera);
  const auto width = static_cast<size_t>(rect.Width());
  for (size_t channel = 0; channel < sums.size(); ++channel) {
    const std::vector<float>* const light_plane = light.Find(camera.channel_names[channel]);
    SHEAF_CHECK(light_plane != nullptr);
    for (int32_t y = rect.y0; y < rect.y1; ++y) {
      const size_t row = image->window.IndexOf(rect.x0, y);
      const float* a = camera.planes[channel].data() + row;
      const float* b = light_plane->data() + row;
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
  AddBias(light, rect, image);
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
  if (HasMergeBias(outputs)) {
    for (const char* component : kColors) {
      const std::string name = MergeBiasChannel(component);
      channels.push_back({name, name});
    }
  }
  return channels;
}

void SetLightLayer(const FrameImage& light, FrameImage* image) {
  SHEAF_CHECK(light.window == image->window);
  for (const auto& [of_image, of_layer] : LightLayerChannels(light.outputs)) {
    std::vector<float>* plane = image->Find(of_layer);
    if (plane == nullptr) {
      image->channel_names.push_back(of_layer);
      plane = &image->planes.emplace_back();
    }
    *plane = *light.Find(of_image);
  }
}

}  // namespace sheaf
