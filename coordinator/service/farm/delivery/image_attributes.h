// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ImageAttributes: the standard attributes of delivered images (software, worldToCamera,
// worldToNDC). They depend only on the frame and the version, so that equal frames give equal
// files. Dates, hosts and users are added to copies (cli/job/format/image_format.h).
#pragma once

#include <map>
#include <string>

#include "common/content/blob_store.h"

namespace sheaf::coordinator {

class ImageAttributes {
 public:
  // `blobs` must outlive the object.
  explicit ImageAttributes(const BlobStore* blobs) : blobs_(blobs) {}

  // In the form of FrameImage::attributes. Omits the camera's if the scene's manifest has none, or
  // cannot be read.
  // Thread safety: may be called concurrently.
  std::map<std::string, std::string> Of(const BlobDigest& scene) const;

 private:
  const BlobStore* const blobs_;
};

}  // namespace sheaf::coordinator
