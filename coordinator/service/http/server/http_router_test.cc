// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/http/server/http_router.h"

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;

// Answers with the pattern's parameters, separated by bars.
HttpResponse Echo(const HttpRequest& request) {
  HttpResponse response;
  for (const std::string& parameter : request.path_parameters) {
    absl::StrAppend(&response.body, parameter, "|");
  }
  return response;
}

HttpRouter MakeRouter() {
  return HttpRouter({{"GET", "/jobs", Echo},
                     {"GET", "/jobs/{}", Echo},
                     {"POST", "/jobs/{}:cancel", Echo},
                     {"GET", "/jobs/{}/frames/{}/output.exr", Echo}},
                    {"Farm.example"});
}

HttpRequest Get(const std::string& target) {
  HttpRequest request;
  request.method = "GET";
  request.target = target;
  request.headers = {{"host", "localhost:8080"}};
  return request;
}

HttpRequest Post(const std::string& target) {
  HttpRequest request = Get(target);
  request.method = "POST";
  request.headers.emplace_back("x-sheaf-request", "1");
  return request;
}

TEST(HttpRouterTest, DecodesParameters) {
  EXPECT_EQ(MakeRouter().Route(Get("/jobs/a%2Fb")).body, "a/b|");
  EXPECT_EQ(MakeRouter().Route(Get("/jobs/7/frames/12/output.exr")).body, "7|12|");
  EXPECT_EQ(MakeRouter().Route(Post("/jobs/7:cancel")).body, "7|");
}

TEST(HttpRouterTest, UnknownPathsAndMethodsAreRefused) {
  EXPECT_EQ(MakeRouter().Route(Get("/jobs/7/frames")).status, 404);
  EXPECT_EQ(MakeRouter().Route(Get("/jobs/7/")).status, 404);
  EXPECT_EQ(MakeRouter().Route(Post("/jobs")).status, 405);
}

TEST(HttpRouterTest, MalformedEscapesAreRefused) {
  EXPECT_EQ(MakeRouter().Route(Get("/jobs/%4")).status, 404);
  EXPECT_EQ(MakeRouter().Route(Get("/jobs?page_token=%zz")).status, 400);
}

TEST(HttpRouterTest, QueryIsPassedToTheFunction) {
  const HttpRouter router({{"GET", "/q",
                            [](const HttpRequest& request) {
                              HttpResponse response;
                              response.body = QueryValue(request, "b");
                              return response;
                            }}},
                          {});
  EXPECT_EQ(router.Route(Get("/q?a=1&b=two%20words&c")).body, "two words");
}

TEST(HttpRouterTest, OnlyAllowedHostsAreAnswered) {
  for (const char* host : {"localhost", "LOCALHOST:1", "127.0.0.1:8080", "[::1]:8080", "10.1.2.3",
                           "farm.example:80"}) {
    HttpRequest request = Get("/jobs");
    request.headers = {{"Host", host}};
    EXPECT_EQ(MakeRouter().Route(request).status, 200) << host;
  }
  for (const char* host : {"", "evil.example", "localhost.evil.example", "127.0.0.1.evil.example",
                           "1.2.3.4.5", "0x7f.0.0.1"}) {
    HttpRequest request = Get("/jobs");
    request.headers = {{"Host", host}};
    EXPECT_EQ(MakeRouter().Route(request).status, 403) << host;
  }
}

TEST(HttpRouterTest, ChangesNeedHeaderAndOrigin) {
  HttpRequest bare = Post("/jobs/7:cancel");
  bare.headers.pop_back();
  const HttpResponse refusal = MakeRouter().Route(bare);
  EXPECT_EQ(refusal.status, 403);
  EXPECT_THAT(refusal.body, HasSubstr("X-Sheaf-Request"));

  HttpRequest foreign = Post("/jobs/7:cancel");
  foreign.headers.emplace_back("Origin", "http://evil.example");
  EXPECT_EQ(MakeRouter().Route(foreign).status, 403);

  for (const char* origin : {"https://x://localhost:8080", "x://localhost:8080", "null",
                             "http://localhost:80801", "http://evil.localhost:8080"}) {
    HttpRequest near = Post("/jobs/7:cancel");
    near.headers.emplace_back("Origin", origin);
    EXPECT_EQ(MakeRouter().Route(near).status, 403) << origin;
  }

  HttpRequest own = Post("/jobs/7:cancel");
  own.headers.emplace_back("Origin", "http://localhost:8080");
  EXPECT_EQ(MakeRouter().Route(own).status, 200);
}

TEST(HttpRouterTest, ErrorsAreValidJson) {
  const HttpResponse response = HttpError(404, "NOT_FOUND", "no \"\xff\" here");
  EXPECT_EQ(response.content_type, "application/json");
  EXPECT_EQ(response.body,
            "{\"error\":{\"code\":\"NOT_FOUND\",\"message\":\"no \\\"\xEF\xBF\xBD\\\" here\"}}\n");
}

}  // namespace
}  // namespace sheaf::coordinator
