// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The name of a picture's content, the same for a picture in memory and for one read from a file.
#pragma once

#include <string>

#include "common/film/frame_picture.h"

namespace sheaf::cli {

// PictureDigest with the channels in the film's order, others after them as they come: EXR files
// keep channels by name, the coordinator digests them in the order of MakeFramePicture.
std::string PictureIdentity(const FramePicture& picture);

}  // namespace sheaf::cli
