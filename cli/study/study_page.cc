// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/study_page.h"

#include "common/base/check.h"

namespace sheaf::cli {
namespace {

constexpr std::string_view kMark = "@study@";

}  // namespace

std::string StudyPage(std::string_view study_json) {
  const std::string_view page = StudyPageTemplate();
  const size_t mark = page.find(kMark);
  SHEAF_CHECK(mark != std::string_view::npos);
  std::string whole(page.substr(0, mark));
  whole.reserve(page.size() + study_json.size());
  // In JSON, '<' occurs in strings only, where it may be escaped. Unescaped, "</script" would end
  // the element, and "<!--" with "<script" would keep it open beyond its end (HTML Living Standard,
  // 4.12.1.3, "Restrictions for contents of script elements").
  for (const char c : study_json) {
    if (c == '<') {
      whole += "\\u003c";
    } else {
      whole += c;
    }
  }
  whole += page.substr(mark + kMark.size());
  return whole;
}

}  // namespace sheaf::cli
