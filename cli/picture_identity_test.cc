// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/picture_identity.h"

#include <gtest/gtest.h>

#include <utility>

#include "common/film/film.h"

namespace sheaf::cli {
namespace {

TEST(PictureIdentityTest, DoesNotDependOnTheOrderOfChannels) {
  FramePicture picture = MakeFramePicture({0, 0, 2, 1}, 2, 1);
  picture.planes[0] = {1, 2};
  picture.planes[2] = {3, 4};
  EXPECT_EQ(PictureIdentity(picture), PictureDigest(picture));
  FramePicture reordered = picture;
  std::swap(reordered.channel_names[0], reordered.channel_names[2]);
  std::swap(reordered.planes[0], reordered.planes[2]);
  EXPECT_EQ(PictureIdentity(reordered), PictureIdentity(picture));
  reordered.planes[0][0] += 1;
  EXPECT_NE(PictureIdentity(reordered), PictureIdentity(picture));
}

}  // namespace
}  // namespace sheaf::cli
