// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/image/view_transform.h"

#include <OpenColorIO/OpenColorIO.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <optional>
#include <sstream>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "cli/image/tone_map.h"
#include "cli/image/view_config.h"
#include "common/base/check.h"
#include "common/base/file.h"
#include "common/base/status.h"
#include "common/scene/spectrum/primaries.h"

namespace sheaf::cli {
namespace {

namespace ocio = OCIO_NAMESPACE;

constexpr const char* kOwnSrgbView = "sRGB";
// The largest half float; look-up tables of configs end there.
constexpr float kShownMax = 65504;
// Pixels that are converted together.
constexpr size_t kBlockPixelCount = size_t{1} << 16;

// A color space that connects a config to known primaries.
struct Anchor {
  const char* name;
  Primaries primaries;
};
// The role that OpenColorIO 2 defines for it, and names for configs without the role. Names match
// aliases too.
constexpr Anchor kAnchors[] = {
    {"aces_interchange", Primaries::kAces2065},       {"ACES2065-1", Primaries::kAces2065},
    {"ACES - ACES2065-1", Primaries::kAces2065},      {"lin_ap0", Primaries::kAces2065},
    {"Linear Rec.709 (sRGB)", Primaries::kSrgb},      {"lin_rec709", Primaries::kSrgb},
    {"Utility - Linear - Rec.709", Primaries::kSrgb}, {"Utility - Linear - sRGB", Primaries::kSrgb},
};

std::string ConfigName(const ViewArguments& arguments) {
  return arguments.config.empty() ? "Sheaf's own config" : arguments.config;
}

// The config is not validated as a whole: only the parts that the view needs are tried; others may
// lack files.
ocio::ConstConfigRcPtr ReadConfig(const ViewArguments& arguments) {
  if (!arguments.config.empty()) return ocio::Config::CreateFromFile(arguments.config.c_str());
  std::istringstream text{std::string(kOwnViewConfig)};
  return ocio::Config::CreateFromStream(text);
}

std::vector<std::string> DisplaysOf(const ocio::Config& config) {
  std::vector<std::string> names;
  for (int i = 0; i < config.getNumDisplays(); ++i) names.emplace_back(config.getDisplay(i));
  return names;
}

std::vector<std::string> ViewsOf(const ocio::Config& config, const std::string& display) {
  std::vector<std::string> names;
  for (int i = 0; i < config.getNumViews(display.c_str()); ++i) {
    names.emplace_back(config.getView(display.c_str(), i));
  }
  return names;
}

// `asked` as it is spelled among `names`, or `otherwise` if `asked` is empty. owner, kind: for
// messages.
absl::StatusOr<std::string> Choose(const std::string& asked, const std::string& otherwise,
                                   const std::vector<std::string>& names, const std::string& owner,
                                   const std::string& kind) {
  if (asked.empty()) return otherwise;
  for (const std::string& name : names) {
    if (absl::EqualsIgnoreCase(name, asked)) return name;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("--", kind, ": ", owner, " has no ", kind, " \"", asked,
                   "\"; it has: ", names.empty() ? "none" : absl::StrJoin(names, ", ")));
}

absl::StatusOr<Anchor> AnchorOf(const ocio::Config& config, const std::string& name) {
  for (const Anchor& anchor : kAnchors) {
    if (config.getColorSpace(anchor.name) != nullptr) return anchor;
  }
  return absl::InvalidArgumentError(
      absl::StrCat(name,
                   ": does not identify its color space ACES2065-1; give that color space "
                   "the role aces_interchange"));
}

// Whether the view shows raw numbers instead of colors.
bool ShowsData(const ocio::Config& config, const std::string& display, const std::string& view) {
  const char* name = config.getDisplayViewColorSpaceName(display.c_str(), view.c_str());
  const ocio::ConstColorSpaceRcPtr space = config.getColorSpace(name);
  return space != nullptr && space->isData();
}

// Converts numbers from the given chromaticities to the color space, mapping white to white.
// Degenerate chromaticities are replaced by sRGB's.
Matrix4 AnchorFromImage(Primaries primaries, const Chromaticities& chromaticities) {
  const Chromaticities anchor = ChromaticitiesOf(primaries);
  if (chromaticities == anchor) return Matrix4();
  const std::optional<Matrix4> xyz_from_image = XyzFromRgb(chromaticities);
  if (!xyz_from_image) return AnchorFromImage(primaries, Chromaticities());
  Matrix4 anchor_from_xyz;
  SHEAF_CHECK(Invert(*XyzFromRgb(anchor), &anchor_from_xyz));
  return anchor_from_xyz * AdaptWhite(chromaticities.white, anchor.white) * *xyz_from_image;
}

ocio::ConstTransformRcPtr TransformOf(const Matrix4& matrix) {
  std::array<double, 16> values{};
  for (size_t i = 0; i < values.size(); ++i) values[i] = matrix.m[i / 4][i % 4];
  const ocio::MatrixTransformRcPtr transform = ocio::MatrixTransform::Create();
  transform->setMatrix(values.data());
  return transform;
}

float Finite(float value) {
  return std::isnan(value) ? 0 : std::clamp(value, -kShownMax, kShownMax);
}

uint8_t Quantize(float value) {
  return value > 0 ? static_cast<uint8_t>(std::min(value, 1.0f) * 255 + 0.5f) : 0;
}

}  // namespace

struct ViewTransform::Opened {
  ocio::ConstConfigRcPtr config;
  std::string anchor;  // Empty: the view shows data.
  Primaries anchor_primaries = Primaries::kSrgb;

  // From numbers in the given chromaticities to the display's. Throws OpenColorIO's exceptions.
  ocio::ConstCPUProcessorRcPtr ProcessorFor(const Chromaticities& chromaticities,
                                            const std::string& display,
                                            const std::string& view) const {
    const ocio::GroupTransformRcPtr group = ocio::GroupTransform::Create();
    if (!anchor.empty()) {
      const ocio::DisplayViewTransformRcPtr transform = ocio::DisplayViewTransform::Create();
      transform->setSrc(anchor.c_str());
      transform->setDisplay(display.c_str());
      transform->setView(view.c_str());
      group->appendTransform(
          TransformOf(AnchorFromImage(anchor_primaries, chromaticities))->createEditableCopy());
      group->appendTransform(transform);
    }
    return config->getProcessor(group)->getOptimizedCPUProcessor(ocio::OPTIMIZATION_LOSSLESS);
  }
};

absl::StatusOr<ViewTransform> ViewTransform::OpenOrThrow(const ViewArguments& arguments) {
  const std::string name = ConfigName(arguments);
  const auto opened = std::make_shared<Opened>();
  opened->config = ReadConfig(arguments);
  const ocio::Config& config = *opened->config;
  const absl::StatusOr<std::string> display =
      Choose(arguments.display, config.getDefaultDisplay(), DisplaysOf(config), name, "display");
  if (!display.ok()) return display.status();
  const absl::StatusOr<std::string> view =
      Choose(arguments.view, config.getDefaultView(display->c_str()), ViewsOf(config, *display),
             absl::StrCat("display \"", *display, "\" of ", name), "view");
  if (!view.ok()) return view.status();
  ViewTransform result;
  result.display_ = *display;
  result.view_ = *view;
  if (arguments.config.empty() && *view == kOwnSrgbView) return result;
  if (!ShowsData(config, *display, *view)) {
    const absl::StatusOr<Anchor> anchor = AnchorOf(config, name);
    if (!anchor.ok()) return anchor.status();
    opened->anchor = anchor->name;
    opened->anchor_primaries = anchor->primaries;
  }
  // Finds missing parts of the view now, such as the file of a look-up table.
  opened->ProcessorFor(Chromaticities(), *display, *view);
  result.opened_ = opened;
  return result;
}

absl::StatusOr<ViewTransform> ViewTransform::Open(const ViewArguments& arguments) {
  const absl::StatusOr<Exposure> exposure = ParseExposure(arguments.exposure);
  if (!exposure.ok()) return Annotate(exposure.status(), "--exposure");
  if (arguments.config.empty() && !arguments.IsActive()) {  // Needs no config.
    ViewTransform result;
    result.set_exposure(*exposure);
    return result;
  }
  try {
    absl::StatusOr<ViewTransform> opened = OpenOrThrow(arguments);
    if (opened.ok()) opened->set_exposure(*exposure);
    return opened;
  } catch (const std::exception& error) {
    return absl::InvalidArgumentError(
        absl::StrCat("--ocio ", ConfigName(arguments), ": ", error.what()));
  }
}

bool ViewTransform::ShowsNumbers() const { return opened_ != nullptr && opened_->anchor.empty(); }

double ViewTransform::StopsFor(const FrameImage& frame_image) const {
  if (!exposure_.is_automatic) return exposure_.stops;
  return ShowsNumbers() ? 0 : AutomaticStops(frame_image);
}

PngTags ViewTransform::Tags() const {
  PngTags tags;
  tags.text = {{"View", view_}, {"Display", display_}};
  tags.is_srgb = !ShowsNumbers() && absl::StrContains(absl::AsciiStrToLower(display_), "srgb");
  return tags;
}

std::vector<Rgb8> ViewTransform::ShowOrThrow(const FrameImage& frame_image) const {
  const std::array<const std::vector<float>*, 3> planes{
      frame_image.Find("R"), frame_image.Find("G"), frame_image.Find("B")};
  for (const std::vector<float>* plane : planes) SHEAF_CHECK(plane != nullptr);
  const ocio::ConstCPUProcessorRcPtr processor =
      opened_->ProcessorFor(frame_image.color.chromaticities, display_, view_);
  std::vector<Rgb8> pixels(planes[0]->size());
  std::vector<float> block;
  for (size_t first = 0; first < pixels.size(); first += kBlockPixelCount) {
    const size_t count = std::min(kBlockPixelCount, pixels.size() - first);
    block.resize(3 * count);
    for (size_t i = 0; i < block.size(); ++i) block[i] = Finite((*planes[i % 3])[first + i / 3]);
    ocio::PackedImageDesc image(block.data(), static_cast<long>(count), 1, 3);
    processor->apply(image);
    for (size_t i = 0; i < count; ++i) {
      pixels[first + i] = {Quantize(block[3 * i]), Quantize(block[3 * i + 1]),
                           Quantize(block[3 * i + 2])};
    }
  }
  return pixels;
}

absl::StatusOr<std::vector<Rgb8>> ViewTransform::Show(const FrameImage& frame_image) const {
  if (const double stops = StopsFor(frame_image); stops != 0) {
    ViewTransform unexposed = *this;
    unexposed.set_exposure({});
    return unexposed.Show(Exposed(frame_image, stops));
  }
  if (opened_ == nullptr) return ToneMapSrgb(frame_image);
  try {
    return ShowOrThrow(frame_image);
  } catch (const std::exception& error) {
    return absl::InternalError(absl::StrCat("view \"", view_, "\": ", error.what()));
  }
}

absl::Status WriteView(const ViewTransform& view, const FrameImage& frame_image,
                       const std::string& path) {
  const absl::StatusOr<std::vector<Rgb8>> pixels = view.Show(frame_image);
  if (!pixels.ok()) return pixels.status();
  const absl::StatusOr<std::string> bytes = EncodeTaggedPng(
      frame_image.window.Width(), frame_image.window.Height(), *pixels, view.Tags());
  if (!bytes.ok()) return bytes.status();
  return WriteFileAtomically(path, *bytes);
}

}  // namespace sheaf::cli
