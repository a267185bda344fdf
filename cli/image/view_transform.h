// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ViewTransform: linear pictures to what a display shows, by a view that a config of OpenColorIO
// names. The only door to OpenColorIO.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/frame_picture.h"
#include "common/image/png_tags.h"

namespace sheaf::cli {

// As asked for; empty is the default of each.
struct ViewArguments {
  std::string config;   // A file; empty: Sheaf's own (view_config.h).
  std::string display;  // Empty: the config's first.
  std::string view;     // Empty: the display's first.

  // Something beside the config is asked for, which may come from the environment.
  bool IsActive() const { return !display.empty() || !view.empty(); }
};

// Copies share what was read. Thread safety: const methods may be called concurrently.
class ViewTransform {
 public:
  // The view sRGB of Sheaf's own config.
  ViewTransform() = default;
  // Names are matched without regard to case. Errors: kInvalidArgument where the config cannot be
  // read, lacks the display or the view (the message says which it has), or does not say what its
  // colors are.
  static absl::StatusOr<ViewTransform> Open(const ViewArguments& arguments);

  // As the config spells it.
  const std::string& view() const { return view_; }
  // What a PNG of it shall say.
  PngTags Tags() const;

  // The channels R, G, B as displayed, row-major over the picture's window. The picture's
  // chromaticities say what its numbers mean: its white becomes the config's white (Bradford),
  // except in the view sRGB of Sheaf's own, which is ToneMapSrgb and adapts nothing. Views of
  // data get the numbers as they are. Values that are not finite are cut to those of half floats,
  // NaN is 0. Requires: R, G and B are there. Errors: kInternal where OpenColorIO fails.
  absl::StatusOr<std::vector<Rgb8>> Show(const FramePicture& picture) const;

 private:
  struct Opened;
  // The same as Open and Show, with the library's exceptions.
  static absl::StatusOr<ViewTransform> OpenOrThrow(const ViewArguments& arguments);
  std::vector<Rgb8> ShowOrThrow(const FramePicture& picture) const;

  std::shared_ptr<const Opened> opened_;  // Null: ToneMapSrgb.
  std::string view_ = "sRGB", display_ = "sRGB";
};

// Writes the picture as the view shows it. Errors: those of Show and of writing.
absl::Status WriteView(const ViewTransform& view, const FramePicture& picture,
                       const std::string& path);

}  // namespace sheaf::cli
