// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Stereo images in files. In memory a stereo image is that of both eyes side by side, the left one
// first; its metadata has kViewsKey. A file has both as views of one image of half the width, as
// OpenEXR's multi-view convention says: the attribute multiView is "left", "right"; channels of the
// left view, which is the default, are R, G, B, A as ever, all others have the view's name before
// their last component: right.R, albedo.left.R, albedo.right.R. The layer of the eyes' difference
// is of no view and keeps its name. Source: "OpenEXR Multi-View Images", openexr.com, 2013.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "common/film/frame_image.h"

namespace sheaf {

// The attribute of stereo images; its value is kStereoViews.
inline constexpr char kViewsKey[] = "views";
inline constexpr char kStereoViews[] = "left,right";
inline constexpr const char* kViewNames[] = {"left", "right"};

bool IsStereoImage(const FrameImage& image);

// The name in files of a view's channel, and the number of the view and the channel's name in the
// image. Names in files are those of FileChannelName; nothing for channels of no view.
std::string ViewChannelName(const std::string& file_name, size_t view);
std::optional<std::pair<size_t, std::string>> ChannelOfView(const std::string& file_name);
// Whether a channel is of no view, as the difference of the eyes is.
bool IsOfNoView(std::string_view name);
// "albedo" of "albedo.right"; other layers as they are.
std::string_view WithoutView(std::string_view layer);

// The image as files have it, with views. Requires: IsStereoImage, and an even width.
FrameImage SplitViews(const FrameImage& image);
// The inverse. Leaves an image as it is that does not have the same channels in both views, or
// whose metadata does not say that it is a stereo image.
void JoinViews(FrameImage* image);

}  // namespace sheaf
