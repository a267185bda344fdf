// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/text/utf8.h"

#include <gtest/gtest.h>

namespace sheaf {
namespace {

TEST(Utf8Test, AcceptsAllCharactersAndNothingElse) {
  for (const char* text : {"", "plain", "a\nb\x01", "gr\xc3\xbcn", "\xe2\x82\xac",
                           "\xf0\x9f\x98\x80", "\xc2\x80", "\xf4\x8f\xbf\xbf"}) {
    EXPECT_TRUE(IsUtf8(text)) << text;
  }
  for (const char* text : {"sc\xe9ne", "\xc3", "\xc0\x80", "\xe0\x80\x80", "\xed\xa0\x80",
                           "\xf4\x90\x80\x80", "\x80", "\xff", "\xe2\x82"}) {
    EXPECT_FALSE(IsUtf8(text)) << text;
  }
}

TEST(Utf8Test, PrefixesEndWithWholeCharacters) {
  EXPECT_EQ(Utf8Prefix("abc", 3), "abc");
  EXPECT_EQ(Utf8Prefix("abc", 2), "ab");
  EXPECT_EQ(Utf8Prefix("a\xe2\x82\xac", 3), "a");
  EXPECT_EQ(Utf8Prefix("a\xe2\x82\xac", 4), "a\xe2\x82\xac");
  EXPECT_EQ(Utf8Prefix("\x80\x80\x80", 2), "");
}

}  // namespace
}  // namespace sheaf
