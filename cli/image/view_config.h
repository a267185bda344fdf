// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Sheaf's own OpenColorIO config, used if no other is given: one display and three views, made only
// of transforms built into the library.
#pragma once

#include <string_view>

namespace sheaf::cli {

// "sRGB" shows the colors that an sRGB screen can show and clips the others. "ACES 1.0 SDR" is the
// Academy's rendering for video of 100 nits. "Raw" shows the numbers in the file.
inline constexpr std::string_view kOwnViewConfig = R"(ocio_profile_version: 2
search_path: ""
roles:
  aces_interchange: ACES2065-1
  cie_xyz_d65_interchange: CIE XYZ D65
  default: Raw
  scene_linear: ACES2065-1
file_rules:
  - !<Rule> {name: Default, colorspace: default}
displays:
  sRGB:
    - !<View> {name: sRGB, view_transform: Colorimetric, display_colorspace: sRGB}
    - !<View> {name: ACES 1.0 SDR, view_transform: ACES 1.0 SDR, display_colorspace: sRGB}
    - !<View> {name: Raw, colorspace: Raw}
default_view_transform: Colorimetric
view_transforms:
  - !<ViewTransform>
    name: Colorimetric
    from_scene_reference: !<BuiltinTransform> {style: UTILITY - ACES-AP0_to_CIE-XYZ-D65_BFD}
  - !<ViewTransform>
    name: ACES 1.0 SDR
    from_scene_reference: !<BuiltinTransform>
      style: ACES-OUTPUT - ACES2065-1_to_CIE-XYZ-D65 - SDR-VIDEO_1.0
display_colorspaces:
  - !<ColorSpace>
    name: CIE XYZ D65
  - !<ColorSpace>
    name: sRGB
    from_display_reference: !<BuiltinTransform> {style: DISPLAY - CIE-XYZ-D65_to_sRGB}
colorspaces:
  - !<ColorSpace>
    name: ACES2065-1
  - !<ColorSpace>
    name: Raw
    isdata: true
)";

}  // namespace sheaf::cli
