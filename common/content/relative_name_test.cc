// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/content/relative_name.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace sheaf {
namespace {

TEST(RelativeNameTest, NamesBelowAFolderAreGood) {
  for (const char* name : {"scene.pbrt", "textures/wood 1.png", "a/b/c/d.ply", "..a/b..", ".hidden",
                           "gl\xc3\xa4ser.pbrt"}) {
    EXPECT_TRUE(CheckRelativeName(name).ok()) << name;
  }
}

TEST(RelativeNameTest, NamesThatLeadElsewhereAreRefused) {
  const std::string zero("a\0b", 3);
  for (const std::string& name :
       {std::string(), std::string("/etc/passwd"), std::string("../a"), std::string("a/../../b"),
        std::string("a/.."), std::string("./a"), std::string("a//b"), std::string("a/"),
        std::string("a\\..\\b"), std::string("a\nb"), std::string("\xff"), zero}) {
    EXPECT_TRUE(absl::IsInvalidArgument(CheckRelativeName(name))) << name;
  }
}

TEST(RelativeNameTest, LengthsAreLimited) {
  EXPECT_TRUE(CheckRelativeName(std::string(kRelativeNamePartBytesMax, 'a')).ok());
  EXPECT_FALSE(CheckRelativeName(std::string(kRelativeNamePartBytesMax + 1, 'a')).ok());
  std::string deep = "a";
  for (size_t i = 1; i < kRelativeNamePartsMax; ++i) deep += "/a";
  EXPECT_TRUE(CheckRelativeName(deep).ok());
  EXPECT_FALSE(CheckRelativeName(deep + "/a").ok());
  std::string parts = std::string(250, 'a');
  for (int i = 0; i < 4; ++i) parts += "/" + std::string(250, 'a');
  const absl::Status status = CheckRelativeName(parts);
  EXPECT_THAT(std::string(status.message()), ::testing::HasSubstr("longer than 1024 bytes"));
}

}  // namespace
}  // namespace sheaf
