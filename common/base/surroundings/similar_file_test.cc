// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/surroundings/similar_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

namespace sheaf {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

std::string Utf8(const char8_t* text) { return reinterpret_cast<const char*>(text); }

TEST(SimilarFileTest, SkeletonsKnowCaseAndNormalization) {
  const std::pair<const char8_t*, const char8_t*> equal[] = {
      {u8"Room.PBRT", u8"room.pbrt"},
      {u8"K\u00fcche", u8"Ku\u0308che"},
      {u8"\u00c5ngstr\u00f6m", u8"a\u030angstro\u0308m"},
      {u8"Vi\u1ec7t", u8"Vie\u0323\u0302t"},
      {u8"\u0439\u0451\u0457", u8"\u0438\u0306\u0435\u0308\u0456\u0308"},
      {u8"\u041c\u0438\u0440", u8"\u043c\u0438\u0440"},
      {u8"\u304c\u3073\u3077\u3065", u8"\u304b\u3099\u3072\u3099\u3075\u309a\u3064\u3099"},
      {u8"\u30ac\u30f4\u30dd", u8"\u30ab\u3099\u30a6\u3099\u30db\u309a"},
      {u8"\ud55c\uad6d", u8"\u1112\u1161\u11ab\u1100\u116e\u11a8"},
  };
  for (const auto& [a, b] : equal) EXPECT_EQ(NameSkeleton(Utf8(a)), NameSkeleton(Utf8(b)));
  const std::pair<const char8_t*, const char8_t*> different[] = {
      {u8"room1", u8"room2"}, {u8"\u00e6", u8"ae"},          {u8"\u304b", u8"\u30ab"},
      {u8"\u00f8", u8"o"},    {u8"\u3063", u8"\u3064"},      {u8"\uac00", u8"\uac01"},
      {u8"a b", u8"ab"},      {u8"\u65e5\u672c", u8"\u65e5"}};
  for (const auto& [a, b] : different) EXPECT_NE(NameSkeleton(Utf8(a)), NameSkeleton(Utf8(b)));
  EXPECT_EQ(NameSkeleton(""), "");
  EXPECT_NE(NameSkeleton("\xff\xc3"), NameSkeleton("\xff"));
}

TEST(SimilarFileTest, FindsFilesAndFolders) {
  const fs::path root = fs::path(testing::TempDir()) / ("similar " + std::to_string(::getpid()));
  const std::string composed = Utf8(u8"K\u00fcche.ply"), decomposed = Utf8(u8"Ku\u0308che.ply");
  fs::create_directories(root / "Textures");
  std::ofstream(root / "Textures" / decomposed) << "x";
  EXPECT_THAT(SimilarFileHint(root / "Textures" / composed), HasSubstr("Unicode"));
  EXPECT_EQ(SimilarFileHint(root / "textures" / composed),
            "; there is \"Textures\", in other case");
  EXPECT_EQ(SimilarFileHint(root / "Textures" / "other.ply"), "");
  EXPECT_EQ(SimilarFileHint(""), "");
  fs::remove_all(root);
}

}  // namespace
}  // namespace sheaf
