// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Averages in linear light, then applies the sRGB curve (IEC 61966-2-1), the common exponent or the
// false colors.
#include "coordinator/service/http/image/image_layer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"
#include "common/film/shrink_image.h"
#include "coordinator/service/http/image/false_color.h"
#include "coordinator/service/view/farm_view.h"

namespace sheaf::coordinator {
namespace {

// The fractions of pixels at which the false colors of the error begin and end.
constexpr double kRangeLowFraction = 0.01, kRangeHighFraction = 0.99;
// The fraction of the image's mean in the denominator of relative errors, as in
// common/film/error/error_estimate.h.
constexpr double kErrorFloorFraction = 0.1;
constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

using Planes = std::vector<const std::vector<float>*>;

// The source of a displayed image: its planes, and the squares of pixels that become one pixel.
struct Source {
  Planes planes;
  int32_t width_px = 0;
  int32_t factor = 1;
  int32_t shown_width_px = 0;
  int32_t shown_height_px = 0;
};

// Mean of value(index) over the square of a displayed pixel, ignoring NaN; NaN if all values are.
template <class Value>
float MeanOfSquare(const Source& source, int32_t shown_x, int32_t shown_y, const Value& value) {
  double sum = 0;
  int count = 0;
  for (int32_t y = shown_y * source.factor; y < (shown_y + 1) * source.factor; ++y) {
    const size_t row = static_cast<size_t>(y) * static_cast<size_t>(source.width_px);
    for (int32_t x = shown_x * source.factor; x < (shown_x + 1) * source.factor; ++x) {
      const double one = value(row + static_cast<size_t>(x));
      if (std::isnan(one)) continue;
      sum += one;
      ++count;
    }
  }
  return count > 0 ? static_cast<float>(sum / count) : kUnknown;
}

// Calls shade(x, y) for each displayed pixel in order.
template <class Shade>
void ForEachShown(const Source& source, const Shade& shade) {
  for (int32_t y = 0; y < source.shown_height_px; ++y) {
    for (int32_t x = 0; x < source.shown_width_px; ++x) shade(x, y);
  }
}

std::array<float, 3> MeanColor(const Source& source, int32_t x, int32_t y) {
  std::array<float, 3> color{};
  for (size_t c = 0; c < 3; ++c) {
    const std::vector<float>& plane = *source.planes[c];
    color[c] = MeanOfSquare(source, x, y, [&](size_t i) { return double{plane[i]}; });
  }
  return color;
}

void FillImage(const Source& source, DisplayImage* display) {
  ForEachShown(source, [&](int32_t x, int32_t y) {
    const std::array<float, 3> color = MeanColor(source, x, y);
    display->pixels.push_back(
        {EncodeSrgb8(color[0]), EncodeSrgb8(color[1]), EncodeSrgb8(color[2])});
  });
}

// Returns the mantissas of a color; `exponent` becomes the corresponding level.
Rgb8 EncodeLight(std::array<float, 3> color, uint8_t* exponent) {
  // Above this value the exponent has no level. NaN and negative values become 0.
  constexpr float kLightMax = 0x1p126f;
  for (float& component : color) component = component > 0 ? std::min(component, kLightMax) : 0;
  const float largest = *std::max_element(color.begin(), color.end());
  int power = 0;
  std::frexp(largest, &power);  // largest is in [2^(power - 1), 2^power).
  // Too dark for any exposure that a viewer can choose.
  if (largest == 0 || power <= -128) {
    *exponent = 0;
    return {0, 0, 0};
  }
  const auto level = [power](float component) {
    return static_cast<uint8_t>(std::min(255L, std::lround(std::ldexp(component, 8 - power))));
  };
  *exponent = static_cast<uint8_t>(power + 128);
  return {level(color[0]), level(color[1]), level(color[2])};
}

void FillLight(const Source& source, DisplayImage* display) {
  std::vector<Rgb8> exponents;
  ForEachShown(source, [&](int32_t x, int32_t y) {
    uint8_t exponent = 0;
    display->pixels.push_back(EncodeLight(MeanColor(source, x, y), &exponent));
    exponents.push_back({exponent, exponent, exponent});
  });
  display->pixels.insert(display->pixels.end(), exponents.begin(), exponents.end());
  display->height_px *= 2;
}

// The largest of 1, 2 and 5 times powers of ten that is not above `value`, or the smallest that is
// not below it. Such ranges are readable, and do not change with every version.
double RoundNumber(double value, bool up) {
  const double power = std::pow(10.0, std::floor(std::log10(value)));
  constexpr double kSteps[] = {1, 2, 5, 10};
  constexpr double kSlack = 1e-6;  // Allows for the rounding of the powers.
  double below = power;
  for (const double step : kSteps) {
    if (up && step * power >= value * (1 - kSlack)) return step * power;
    if (step * power <= value * (1 + kSlack)) below = step * power;
  }
  return below;
}

// The value below which this fraction of the values lies. Requires: values is not empty.
float Quantile(std::vector<float>* values, double fraction) {
  const auto index = static_cast<size_t>(fraction * static_cast<double>(values->size() - 1));
  const auto at = values->begin() + static_cast<std::ptrdiff_t>(index);
  std::nth_element(values->begin(), at, values->end());
  return *at;
}

// A range between round numbers, without the few values that are far from the others.
LayerRange LogarithmicRange(const std::vector<float>& values) {
  std::vector<float> known;
  for (const float value : values) {
    if (value > 0 && std::isfinite(value)) known.push_back(value);
  }
  if (known.empty()) return {};
  const double low = RoundNumber(double{Quantile(&known, kRangeLowFraction)}, /*up=*/false);
  const double high = RoundNumber(double{Quantile(&known, kRangeHighFraction)}, /*up=*/true);
  return {low, std::max(high, low * 2)};
}

LayerRange SampleRange(const std::vector<float>& counts) {
  LayerRange range{std::numeric_limits<double>::infinity(), 0};
  for (const float count : counts) {
    if (!(count > 0)) continue;
    range.low = std::min(range.low, double{count});
    range.high = std::max(range.high, double{count});
  }
  return range.high > 0 ? range : LayerRange();
}

// Unknown values are NaN.
void FillLogarithmic(const std::vector<float>& values, const ChosenRange& chosen,
                     DisplayImage* display) {
  const LayerRange range = chosen ? *chosen : LogarithmicRange(values);
  display->range = range;
  for (const float value : values) {
    const bool known = range.high > 0 && !std::isnan(value);
    display->pixels.push_back(known ? Viridis(LogarithmicPlace(range, double{value}))
                                    : kUnknownColor);
  }
}

// Planes: R, G, B, stderr.R, stderr.G, stderr.B, samples.
void FillError(const Source& source, const ChosenRange& chosen, DisplayImage* display) {
  const std::vector<float>& samples = *source.planes[6];
  double sum = 0, count = 0;
  for (size_t i = 0; i < samples.size(); ++i) {
    if (!(samples[i] > 0)) continue;
    for (size_t c = 0; c < 3; ++c) sum += double{(*source.planes[c])[i]};
    count += 3;
  }
  const double floor = count > 0 ? kErrorFloorFraction * sum / count : 0;
  const auto square = [&](size_t i) {
    if (!(samples[i] > 0)) return double{kUnknown};
    double squares = 0;
    for (size_t c = 0; c < 3; ++c) {
      const double value = (*source.planes[c])[i];
      const double error = (*source.planes[3 + c])[i];
      const double scale = value * value + floor * floor;
      squares += scale > 0 ? error * error / scale : 0;
    }
    return squares / 3;
  };
  std::vector<float> errors;
  ForEachShown(source, [&](int32_t x, int32_t y) {
    errors.push_back(std::sqrt(MeanOfSquare(source, x, y, square)));
  });
  FillLogarithmic(errors, chosen, display);
}

void FillSamples(const Source& source, const ChosenRange& chosen, DisplayImage* display) {
  const std::vector<float>& samples = *source.planes[0];
  std::vector<float> counts;
  ForEachShown(source, [&](int32_t x, int32_t y) {
    counts.push_back(MeanOfSquare(source, x, y, [&](size_t i) { return double{samples[i]}; }));
  });
  const LayerRange range = chosen ? *chosen : SampleRange(counts);
  display->range = range;
  const double span = range.high - range.low;
  for (const float count : counts) {
    display->pixels.push_back(count > 0 ? Viridis(span > 0 ? (double{count} - range.low) / span : 1)
                                        : kUnknownColor);
  }
}

void FillTime(const Source& source, const ChosenRange& chosen, DisplayImage* display) {
  const std::vector<float>& seconds = *source.planes[0];
  std::vector<float> times;
  ForEachShown(source, [&](int32_t x, int32_t y) {
    times.push_back(MeanOfSquare(source, x, y, [&](size_t i) {
      return seconds[i] > 0 ? double{seconds[i]} : double{kUnknown};
    }));
  });
  FillLogarithmic(times, chosen, display);
}

}  // namespace

std::optional<ImageLayer> ImageLayerFromName(const std::string& name) {
  if (name.empty() || name == "image") return ImageLayer::kImage;
  if (name == "light") return ImageLayer::kLight;
  if (name == "error") return ImageLayer::kError;
  if (name == "samples") return ImageLayer::kSamples;
  if (name == "time") return ImageLayer::kTime;
  return std::nullopt;
}

std::vector<std::string> ChannelsOf(ImageLayer layer) {
  switch (layer) {
    case ImageLayer::kImage:
    case ImageLayer::kLight:
      return {"R", "G", "B"};
    case ImageLayer::kError:
      return {"R", "G", "B", "stderr.R", "stderr.G", "stderr.B", "samples"};
    case ImageLayer::kSamples:
      return {"samples"};
    case ImageLayer::kTime:
      return {kCpuChannel};
  }
  return {};
}

double LogarithmicPlace(const LayerRange& range, double value) {
  const double low = range.low > 0 ? range.low : range.high * kRangeStartFraction;
  return value > 0 ? (std::log(value) - std::log(low)) / (std::log(range.high) - std::log(low)) : 0;
}

absl::StatusOr<DisplayImage> MakeDisplayImage(const FrameImage& image, ImageLayer layer,
                                              bool full_size, const ChosenRange& range) {
  const bool is_color = layer == ImageLayer::kImage || layer == ImageLayer::kLight;
  // Errors are computed in the image's own primaries, as standard errors are not converted.
  if (is_color && !(image.color.chromaticities == Chromaticities())) {
    FrameImage shown = image;
    if (absl::Status status = ConvertColor(Chromaticities(), &shown); !status.ok()) return status;
    return MakeDisplayImage(shown, layer, full_size, range);
  }
  Source source;
  for (const std::string& channel : ChannelsOf(layer)) {
    source.planes.push_back(image.Find(channel));
    if (source.planes.back() == nullptr) {
      return absl::InternalError(absl::StrCat("the image has no channel ", channel));
    }
  }
  source.width_px = image.window.Width();
  if (!full_size) {
    source.factor = ShrinkFactor(source.width_px, image.window.Height(), kPreviewPixelCountMax);
  }
  source.shown_width_px = source.width_px / source.factor;
  source.shown_height_px = image.window.Height() / source.factor;
  DisplayImage display;
  display.width_px = source.shown_width_px;
  display.height_px = source.shown_height_px;
  display.pixels.reserve(static_cast<size_t>(display.width_px) *
                         static_cast<size_t>(display.height_px));
  switch (layer) {
    case ImageLayer::kImage:
      FillImage(source, &display);
      break;
    case ImageLayer::kLight:
      FillLight(source, &display);
      break;
    case ImageLayer::kError:
      FillError(source, range, &display);
      break;
    case ImageLayer::kSamples:
      FillSamples(source, range, &display);
      break;
    case ImageLayer::kTime:
      FillTime(source, range, &display);
      break;
  }
  return display;
}

}  // namespace sheaf::coordinator
