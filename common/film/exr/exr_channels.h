// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Names of an image's channels in its files. Programs that sort channels into layers want a last
// component of one letter ("multilayer read: unknown channel token" of Blender 3.4 otherwise), so
// that of a count or an id is X: samples is stored as samples.X. In memory, and in digests of
// images, names have no such component.
#pragma once

#include <string>
#include <string_view>

namespace sheaf {

// "samples" > "samples.X"; other names as they are.
std::string FileChannelName(const std::string& name);
// The inverse; names without a component stay as they are.
std::string ImageChannelName(const std::string& file_name);

// "normal" of "normal.X"; "rgba" of R, G, B and A; "uv" of u and v; other names without a component
// as they are.
std::string LayerOfChannel(std::string_view name);
// Whether the channel is a color or an opacity, which tolerates rounding: not that of errors, nor
// of mattes, whose R, G, B and A are ids and coverages.
bool IsColorChannel(std::string_view name);

}  // namespace sheaf
