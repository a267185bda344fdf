// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/http/server/http_page.h"

#include <map>
#include <regex>
#include <set>
#include <string>

#include "coordinator/service/http/server/http_router.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;

std::string HeaderOf(const HttpResponse& response, const std::string& name) {
  for (const auto& [key, value] : response.headers) {
    if (key == name) return value;
  }
  return "";
}

TEST(HttpPageTest, IsSelfContained) {
  std::map<std::string, std::string> type_of;
  for (const PageFile& file : PageFiles()) {
    EXPECT_THAT(file.bytes, HasSubstr("SPDX-License-Identifier")) << file.name;
    type_of["./" + std::string(file.name)] = std::string(file.content_type);
  }
  const HttpRouter page(PageRoutes(), {});
  HttpRequest request;
  request.method = "GET";
  request.target = "/";
  request.headers = {{"Host", "localhost"}};
  const HttpResponse index = page.Route(request);
  ASSERT_EQ(index.status, 200);
  EXPECT_EQ(index.content_type, "text/html; charset=utf-8");
  // Every file that the document refers to must exist, with the right type.
  const std::regex reference("(?:src|href)=\"(\\./[^\"]+)\"");
  std::set<std::string> types;
  for (std::sregex_iterator at(index.body.begin(), index.body.end(), reference), end; at != end;
       ++at) {
    EXPECT_EQ(type_of.count((*at)[1]), 1u) << "the page names " << (*at)[1];
    types.insert(type_of[(*at)[1]]);
  }
  // So must the files that the scripts load.
  const std::regex script("\\./([a-z_]+\\.js)|\"([a-z_]+\\.js)\"");
  int script_count = 0;
  for (const PageFile& file : PageFiles()) {
    const std::string text(file.bytes);
    for (std::sregex_iterator at(text.begin(), text.end(), script), end; at != end; ++at) {
      const std::string name = (*at)[1].str() + (*at)[2].str();
      EXPECT_EQ(type_of.count("./" + name), 1u) << file.name << " loads " << name;
      ++script_count;
    }
  }
  EXPECT_GE(script_count, 3);  // The page itself, the chart, the worker.
  EXPECT_THAT(types, ::testing::ElementsAre("image/svg+xml", "text/css; charset=utf-8",
                                            "text/javascript; charset=utf-8"));
}

TEST(HttpPageTest, IsCached) {
  const HttpRouter page(PageRoutes(), {});
  HttpRequest request;
  request.method = "GET";
  request.target = "/app.js";
  request.headers = {{"Host", "localhost"}};
  const HttpResponse first = page.Route(request);
  EXPECT_EQ(first.status, 200);
  EXPECT_EQ(HeaderOf(first, "Cache-Control"), "no-cache");
  request.headers.emplace_back("If-None-Match", HeaderOf(first, "ETag"));
  EXPECT_EQ(page.Route(request).status, 304);
}

}  // namespace
}  // namespace sheaf::coordinator
