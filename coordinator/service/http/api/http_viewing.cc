// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of HttpApi for close inspection of images: layers, differences, pixels, and images in
// full size.
#include <cmath>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/film/denoised_output.h"
#include "common/film/display/exposure.h"
#include "common/film/display/select_channels.h"
#include "common/film/exr/exr_channels.h"
#include "coordinator/service/http/api/http_api.h"
#include "coordinator/service/http/image/channel_layers.h"
#include "coordinator/service/http/image/image_difference.h"

namespace sheaf::coordinator {
namespace {

using Json = nlohmann::ordered_json;

// The name in of= of the image's own color, as --png-layer has it.
constexpr char kColorLayer[] = "image";

absl::StatusOr<ChannelLayer> FindChannelLayer(const FrameView& frame, const std::string& name) {
  for (ChannelLayer& layer : ChannelLayersOf(frame.settings.outputs)) {
    if (layer.name == name) return std::move(layer);
  }
  return absl::NotFoundError(absl::StrCat("frame ", frame.frame_number, " has no layer \"", name,
                                          "\"; .../layers lists them"));
}

// JSON has only finite numbers.
Json PixelValueJson(float value) {
  if (std::isfinite(value)) return value;
  if (std::isnan(value)) return "nan";
  return value > 0 ? "inf" : "-inf";
}

struct NamedFrame {
  std::string job_id;
  int32_t number = 0;
};

// "jobs/8/frames/1". Errors: kInvalidArgument.
absl::StatusOr<NamedFrame> ParseFrame(const std::string& text) {
  const std::vector<std::string> parts = absl::StrSplit(text, '/');
  NamedFrame name;
  if (parts.size() != 4 || parts[0] != "jobs" || parts[2] != "frames" ||
      !absl::SimpleAtoi(parts[3], &name.number)) {
    return absl::InvalidArgumentError(
        absl::StrCat("with=\"", text, "\" is not the name of a frame, such as jobs/8/frames/1"));
  }
  name.job_id = parts[1];
  return name;
}

absl::StatusOr<DifferenceKind> ParseDifferenceKind(const std::string& text) {
  if (text == "absolute") return DifferenceKind::kAbsolute;
  if (text == "relative") return DifferenceKind::kRelative;
  return absl::InvalidArgumentError(
      absl::StrCat("difference \"", text, "\" is neither absolute nor relative"));
}

absl::StatusOr<ViewedImage> EncodeView(const absl::StatusOr<DisplayImage>& display,
                                       const std::string& version) {
  if (!display.ok()) return display.status();
  absl::StatusOr<std::string> png =
      EncodePng(display->width_px, display->height_px, display->pixels);
  if (!png.ok()) return png.status();
  return ViewedImage{version, *std::move(png), display->range};
}

// The layer that is meant: that of the name, and of an image in full size the least noisy one.
// Empty: R, G and B.
absl::StatusOr<std::optional<ChannelLayer>> ParseLayer(const std::string& of, bool full_size,
                                                       const FrameView& frame) {
  if (of == kColorLayer) return std::nullopt;
  if (!of.empty()) {
    absl::StatusOr<ChannelLayer> layer = FindChannelLayer(frame, of);
    if (!layer.ok()) return layer.status();
    return *std::move(layer);
  }
  if (!full_size) return std::nullopt;
  absl::StatusOr<ChannelLayer> denoised = FindChannelLayer(frame, kDenoisedLayer);
  return denoised.ok() ? std::optional(*std::move(denoised)) : std::nullopt;
}

// The display of three channels of color, exposed.
absl::StatusOr<DisplayImage> MakeColorDisplay(const FrameImage& image,
                                              const std::vector<std::string>& channels,
                                              const Exposure& exposure, ImageLayer as,
                                              bool full_size) {
  absl::StatusOr<FrameImage> color = SelectChannels(image, channels, kColorChannels);
  if (!color.ok()) return color.status();
  const double stops = exposure.is_automatic ? AutomaticStops(*color) : exposure.stops;
  if (stops != 0) *color = Exposed(*color, stops);
  return MakeDisplayImage(*color, as, full_size);
}

// "LOW,HIGH"; "": none.
absl::StatusOr<ChosenRange> ParseRange(const std::string& text) {
  if (text.empty()) return std::nullopt;
  const std::vector<std::string> ends = absl::StrSplit(text, ',');
  LayerRange range;
  if (ends.size() == 2 && absl::SimpleAtod(ends[0], &range.low) &&
      absl::SimpleAtod(ends[1], &range.high) && std::isfinite(range.low) &&
      std::isfinite(range.high) && range.low < range.high) {
    return range;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("range \"", text, "\" is not two numbers, the lower first, as in range=0.01,1"));
}

// The color of a frame, or a layer of kind color, as R, G and B.
absl::StatusOr<PreviewView> ColorOf(const FarmView& farm, const std::string& job_id,
                                    const FrameView& frame, const std::string& of) {
  const absl::StatusOr<std::optional<ChannelLayer>> layer =
      ParseLayer(of, /*full_size=*/false, frame);
  if (!layer.ok()) return layer.status();
  if (layer->has_value() && (*layer)->kind != ChannelKind::kColor) {
    return absl::InvalidArgumentError(
        absl::StrCat("layer \"", of, "\" is not a color, and has no difference"));
  }
  const std::vector<std::string> channels =
      layer->has_value() ? (*layer)->channels : kColorChannels;
  absl::StatusOr<PreviewView> view = farm.Preview(job_id, frame.frame_number, channels);
  if (!view.ok()) return view;
  absl::StatusOr<FrameImage> color = SelectChannels(view->image, channels, kColorChannels);
  if (!color.ok()) return color.status();
  view->image = *std::move(color);
  return view;
}

absl::StatusOr<int32_t> ParseCoordinate(const HttpRequest& request, const std::string& name) {
  const std::string text = QueryValue(request, name);
  int32_t value = 0;
  if (absl::SimpleAtoi(text, &value)) return value;
  return absl::InvalidArgumentError(
      absl::StrCat(name, " \"", text, "\" is not an integer; as in pixel?x=10&y=20"));
}

}  // namespace

HttpResponse HttpApi::GetLayers(const HttpRequest& request) const {
  const absl::StatusOr<FrameView> frame = FindFrame(request);
  if (!frame.ok()) return HttpErrorFromStatus(frame.status());
  Json layers = Json::array();
  for (const ChannelLayer& layer : ChannelLayersOf(frame->settings.outputs)) {
    std::vector<std::string> channels;
    for (const std::string& channel : layer.channels) channels.push_back(FileChannelName(channel));
    layers.push_back({{"name", layer.name},
                      {"kind", ChannelKindName(layer.kind)},
                      {"channels", std::move(channels)}});
  }
  return JsonResponse(Json::object({{"layers", std::move(layers)}}).dump());
}

HttpResponse HttpApi::GetPixel(const HttpRequest& request) const {
  const absl::StatusOr<FrameView> frame = FindFrame(request);
  if (!frame.ok()) return HttpErrorFromStatus(frame.status());
  const absl::StatusOr<int32_t> x = ParseCoordinate(request, "x");
  if (!x.ok()) return HttpErrorFromStatus(x.status());
  const absl::StatusOr<int32_t> y = ParseCoordinate(request, "y");
  if (!y.ok()) return HttpErrorFromStatus(y.status());
  const absl::StatusOr<PixelView> pixel =
      actions_.read_pixel(request.path_parameters[0], frame->frame_number, *x, *y);
  if (!pixel.ok()) return HttpErrorFromStatus(pixel.status());
  Json channels = Json::array();
  for (const auto& [name, value] : pixel->channels) {
    channels.push_back({{"name", name}, {"value", PixelValueJson(value)}});
  }
  return JsonResponse(
      Json::object(
          {{"version", pixel->version}, {"x", *x}, {"y", *y}, {"channels", std::move(channels)}})
          .dump());
}

bool HttpApi::IsView(const HttpRequest& request) {
  return !QueryValue(request, "of").empty() || !QueryValue(request, "with").empty() ||
         !QueryValue(request, "exposure").empty() || !QueryValue(request, "range").empty() ||
         QueryValue(request, "size") == "full";
}

absl::StatusOr<ViewedImage> HttpApi::ViewDifference(const HttpRequest& request,
                                                    const FrameView& frame) const {
  const absl::StatusOr<DifferenceKind> kind =
      ParseDifferenceKind(QueryValue(request, "difference"));
  if (!kind.ok()) return kind.status();
  const absl::StatusOr<NamedFrame> other_name = ParseFrame(QueryValue(request, "with"));
  if (!other_name.ok()) return other_name.status();
  const absl::StatusOr<ChosenRange> range = ParseRange(QueryValue(request, "range"));
  if (!range.ok()) return range.status();
  const absl::StatusOr<FrameView> other_frame = FindFrame(other_name->job_id, other_name->number);
  if (!other_frame.ok()) return other_frame.status();
  absl::StatusOr<PreviewView> image =
      ColorOf(farm_, request.path_parameters[0], frame, QueryValue(request, "of"));
  if (!image.ok()) return image.status();
  absl::StatusOr<PreviewView> other =
      ColorOf(farm_, other_name->job_id, *other_frame, QueryValue(request, "with_of"));
  if (!other.ok()) return other.status();
  if (!(image->image.color.chromaticities == other->image.color.chromaticities)) {
    const Chromaticities& to = image->image.color.chromaticities;
    if (absl::Status same = ConvertColor(to, &other->image); !same.ok()) return same;
  }
  return EncodeView(MakeDifference(image->image, other->image, *kind, *range),
                    absl::StrCat(instance_, "-", image->version, "-", other->version));
}

absl::StatusOr<ViewedImage> HttpApi::View(const HttpRequest& request,
                                          const FrameView& frame) const {
  const std::string& job_id = request.path_parameters[0];
  if (!QueryValue(request, "with").empty()) return ViewDifference(request, frame);
  const std::string of = QueryValue(request, "of");
  const bool full_size = QueryValue(request, "size") == "full";
  const absl::StatusOr<ChosenRange> range = ParseRange(QueryValue(request, "range"));
  if (!range.ok()) return range.status();
  const std::string name = QueryValue(request, "layer");
  const std::optional<ImageLayer> as = ImageLayerFromName(name);
  const bool is_ranged = range->has_value() && of.empty() && !full_size;
  if (!as || (*as != ImageLayer::kImage && *as != ImageLayer::kLight && !is_ranged)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "layer \"", name, "\" is neither image nor light, as of=, exposure= and size=full need"));
  }
  const absl::StatusOr<Exposure> exposure = ParseExposure(QueryValue(request, "exposure"));
  if (!exposure.ok()) {
    return absl::InvalidArgumentError(absl::StrCat("exposure: ", exposure.status().message()));
  }
  const absl::StatusOr<std::optional<ChannelLayer>> layer = ParseLayer(of, full_size, frame);
  if (!layer.ok()) return layer.status();
  if (full_size && !frame.complete) {
    return absl::FailedPreconditionError(
        absl::StrCat("frame ", frame.frame_number,
                     " is not complete yet, and has no full-size image; omit size=full"));
  }
  const std::vector<std::string> channels =
      layer->has_value() ? SourceChannels(**layer) : ChannelsOf(*as);
  const absl::StatusOr<PreviewView> view = farm_.Preview(job_id, frame.frame_number, channels);
  if (!view.ok()) return view.status();
  const std::string version = absl::StrCat(instance_, "-", view->version);
  if (!layer->has_value() && *as != ImageLayer::kImage && *as != ImageLayer::kLight)
    return EncodeView(MakeDisplayImage(view->image, *as, full_size, *range), version);
  const bool is_color = !layer->has_value() || (*layer)->kind == ChannelKind::kColor;
  return EncodeView(is_color ? MakeColorDisplay(view->image, channels, *exposure, *as, full_size)
                             : MakeChannelDisplay(view->image, **layer, *as, *range),
                    version);
}

HttpResponse HttpApi::GetFarm() const {
  const FarmAddress address = actions_.address ? actions_.address() : FarmAddress();
  return JsonResponse(
      Json::object({{"grpc_port", address.grpc_port}, {"tls", address.tls}}).dump());
}

}  // namespace sheaf::coordinator
