// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ImageAttributes: the standard attributes of delivered images (software, worldToCamera,
// worldToNDC). They depend on the frame and the version alone, so that equal frames are equal
// files: dates, hosts and people are added to copies (cli/job/format/image_format.h).
#pragma once

#include <map>
#include <string>

#include "common/content/blob_store.h"

namespace sheaf::coordinator {

class ImageAttributes {
 public:
  // `blobs` must outlive the object.
  explicit ImageAttributes(const BlobStore* blobs) : blobs_(blobs) {}

  // As FrameImage::attributes has them. Without the camera's where the scene's manifest names none,
  // or cannot be read.
  // Thread safety: may be called concurrently.
  std::map<std::string, std::string> Of(const BlobDigest& scene) const;

 private:
  const BlobStore* const blobs_;
};

}  // namespace sheaf::coordinator
