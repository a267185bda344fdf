// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ViewTransform: converts linear images for a display, by an exposure and by a view that an
// OpenColorIO config names.
// All uses of OpenColorIO are in its implementation.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/display/exposure.h"
#include "common/film/frame_image.h"
#include "common/image/png_tags.h"

namespace sheaf::cli {

// The requested view; empty members mean the defaults.
struct ViewArguments {
  std::string config;         // A file; empty: Sheaf's own (view_config.h).
  std::string display;        // Empty: the config's first.
  std::string view;           // Empty: the display's first.
  std::string exposure = {};  // As for ParseExposure.

  // Whether a display or a view is requested; the config may come from the environment.
  bool IsActive() const { return !display.empty() || !view.empty(); }
};

// Copies share the loaded config. Thread safety: const methods may be called concurrently.
class ViewTransform {
 public:
  // The view sRGB of Sheaf's own config.
  ViewTransform() = default;
  // Names match without regard to case. Errors: those of ParseExposure; kInvalidArgument if the
  // config cannot be read, lacks the display or the view (the message lists those it has), or does
  // not define its colors.
  static absl::StatusOr<ViewTransform> Open(const ViewArguments& arguments);

  // As the config spells it.
  const std::string& view() const { return view_; }
  bool is_exposed_automatically() const { return exposure_.is_automatic; }
  void set_exposure(const Exposure& exposure) { exposure_ = exposure; }
  // The stops that Show exposes the image by. An automatic exposure does not change views of data.
  double StopsFor(const FrameImage& frame_image) const;
  // The color tags of a PNG in this view.
  PngTags Tags() const;

  // The channels R, G, B, exposed and as displayed, row-major over the image's window. The image's
  // chromaticities define its numbers: its white becomes the config's white (Bradford), except in
  // the view sRGB of Sheaf's own config, which is ToneMapSrgb and does not adapt. Views of data get
  // the numbers unchanged. Infinite values are clamped to the range of half floats; NaN becomes 0.
  // Requires: R, G and B exist. Errors: kInternal if OpenColorIO fails.
  absl::StatusOr<std::vector<Rgb8>> Show(const FrameImage& frame_image) const;

 private:
  struct Opened;
  // As Open and Show, but they throw the library's exceptions.
  static absl::StatusOr<ViewTransform> OpenOrThrow(const ViewArguments& arguments);
  std::vector<Rgb8> ShowOrThrow(const FrameImage& frame_image) const;
  bool ShowsNumbers() const;

  std::shared_ptr<const Opened> opened_;  // Null: ToneMapSrgb.
  std::string view_ = "sRGB", display_ = "sRGB";
  Exposure exposure_;
};

// Writes the image as the view shows it. Errors: those of Show and of writing.
absl::Status WriteView(const ViewTransform& view, const FrameImage& frame_image,
                       const std::string& path);

}  // namespace sheaf::cli
