// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/study_page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "absl/strings/ascii.h"

namespace sheaf::cli {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr std::string_view kDataStart = R"(<script id="study" type="application/json">)";

size_t Count(std::string_view text, std::string_view part) {
  size_t count = 0;
  for (size_t at = text.find(part); at != std::string_view::npos; at = text.find(part, at + 1)) {
    ++count;
  }
  return count;
}

// The text that a browser takes for the JSON: everything up to the next end tag of a script.
std::string DataOf(std::string_view page) {
  const size_t start = page.find(kDataStart) + kDataStart.size();
  return std::string(page.substr(start, page.find("</script", start) - start));
}

TEST(StudyPageTest, JsonIsEmbeddedUnchanged) {
  const nlohmann::json study = {{"format", 1},
                                {"scene", "</script><script>alert(1)</script><!-- <script @study@"},
                                {"not_studied", {"a \\ b \"c\"", "\xe2\x80\xa8 \xc3\xa9 & >"}}};
  const std::string data = DataOf(StudyPage(study.dump()));
  EXPECT_THAT(data, Not(HasSubstr("<")));
  EXPECT_EQ(nlohmann::json::parse(data), study);
}

TEST(StudyPageTest, JsonCannotAddElements) {
  const std::string harmless = StudyPage(R"({"scene":"a"})");
  const std::string hostile = StudyPage(R"({"scene":"</script><script>alert(1)</script>"})");
  EXPECT_EQ(Count(harmless, "<script"), 2);
  EXPECT_EQ(Count(hostile, "<script"), 2);
  EXPECT_EQ(Count(hostile, "</script"), 2);
}

TEST(StudyPageTest, LoadsNoExternalFiles) {
  const std::string page = absl::AsciiStrToLower(StudyPage("{}"));
  for (const std::string_view part :
       {"http:", "https:", "src=", "@import", "url(", "<link", "import(", "fetch("}) {
    EXPECT_THAT(page, Not(HasSubstr(part)));
  }
  // The only address is a place on the page itself.
  EXPECT_EQ(Count(page, "href="), Count(page, "href=\"#"));
  EXPECT_THAT(page, HasSubstr("default-src 'none'"));
}

TEST(StudyPageTest, EmbedsScriptAndStyle) {
  const std::string page = StudyPage("{}");
  for (const std::string_view mark : {"@study@", "@script@", "@style@"}) {
    EXPECT_THAT(page, Not(HasSubstr(mark)));
  }
  EXPECT_THAT(page, HasSubstr("chart-error"));
  EXPECT_THAT(page, HasSubstr("--panel-edge"));
}

}  // namespace
}  // namespace sheaf::cli
