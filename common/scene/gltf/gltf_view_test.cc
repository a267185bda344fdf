// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/gltf_view.h"

#include <gtest/gtest.h>

namespace sheaf {
namespace {

TEST(GltfViewTest, ReadsWhatItWrites) {
  const GltfView view{"Main camera", "Right camera", "walk", 1.0 / 3,
                      1.0 / 48,      "sky.pfm",      640,    480};
  const auto read = DecodeGltfView(EncodeGltfView(view));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(*read, view);
  EXPECT_EQ(*DecodeGltfView(EncodeGltfView({})), GltfView());
}

TEST(GltfViewTest, RefusesOthersText) {
  for (const char* text :
       {"", "camera Main\n", "sheaf glTF view 1\ntime soon\n", "sheaf glTF view 1\ntime nan\n",
        "sheaf glTF view 1\nshutter -1\n", "sheaf glTF view 1\nwidth 70000\n",
        "sheaf glTF view 1\nlens\n", "sheaf glTF view 1\nlens 50\n"}) {
    EXPECT_FALSE(DecodeGltfView(text).ok()) << text;
  }
}

TEST(GltfViewTest, KnowsNames) {
  EXPECT_TRUE(IsGltfName("a.glb"));
  EXPECT_TRUE(IsGltfName("models/A.GLTF"));
  EXPECT_FALSE(IsGltfName("a.pbrt"));
  EXPECT_FALSE(IsGltfName("glb"));
}

}  // namespace
}  // namespace sheaf
