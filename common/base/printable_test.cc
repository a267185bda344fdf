// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/printable.h"

#include <gtest/gtest.h>

#include <string>

#include "common/base/log.h"

namespace sheaf {
namespace {

TEST(PrintableTest, ControlBytesAreEscaped) {
  EXPECT_EQ(Printable("room \xc3\xa9\xe2\x82\xac\xf0\x9f\x98\x80"),
            "room \xc3\xa9\xe2\x82\xac\xf0\x9f\x98\x80");
  EXPECT_EQ(Printable("\x1b[31mred\x07\x7f\r"), "\\x1b[31mred\\x07\\x7f\\x0d");
  EXPECT_EQ(Printable(std::string_view("a\0b", 3)), "a\\x00b");
  EXPECT_EQ(Printable("\xc2\x9b"
                      "31m"),
            "\\xc2\\x9b31m")
      << "a control beyond ASCII";
  EXPECT_EQ(Printable("\xe2\x80\xaegpj.exe"), "\\xe2\\x80\\xaegpj.exe") << "turns the direction";
}

TEST(PrintableTest, FindsTheFirstUnprintableByte) {
  EXPECT_EQ(FindUnprintable("plain, \"quoted\" \\ and room \xc3\xa9"), std::string_view::npos);
  EXPECT_EQ(FindUnprintable("\xc3\xa9\ntwo"), 2u);
}

TEST(PrintableTest, LogEventsStayOnOneLine) {
  ::testing::internal::CaptureStderr();
  LogWarning("a title\n2026-01-01T00:00:00.000+00:00 sheaf info forged");
  const std::string logged = ::testing::internal::GetCapturedStderr();
  EXPECT_EQ(logged.find('\n'), logged.size() - 1) << logged;
  EXPECT_NE(logged.find("a title\\n2026"), std::string::npos) << logged;
}

TEST(PrintableTest, InvalidUtf8IsShownByteByByte) {
  EXPECT_EQ(Printable("\xff\xfe"), "\\xff\\xfe");
  EXPECT_EQ(Printable("cut \xe2\x82"), "cut \\xe2\\x82");
  EXPECT_EQ(Printable("\xc0\xaf"), "\\xc0\\xaf") << "overlong";
  EXPECT_EQ(Printable("\xe0\x80\xaf"), "\\xe0\\x80\\xaf") << "overlong";
  EXPECT_EQ(Printable("\xed\xa0\x80"), "\\xed\\xa0\\x80") << "a surrogate";
  EXPECT_EQ(Printable("\xf4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80") << "beyond Unicode";
}

TEST(PrintableTest, LinesStaySingleAndLongTextIsTruncated) {
  EXPECT_EQ(Printable("title\n2026-01-01 forged\tline"), "title\\n2026-01-01 forged line");
  EXPECT_EQ(PrintableLines("two\nlines\x1b"), "two\nlines\\x1b");
  EXPECT_EQ(Printable("abcdef", 4), "abcd...");
  EXPECT_EQ(Printable("abc\xc3\xa9", 4), "abc...") << "no half characters";
  EXPECT_EQ(Printable("abcd", 4), "abcd");
}

}  // namespace
}  // namespace sheaf
