// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Accounts, times of requests and figures of the server over HTTP.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "coordinator/service/http/api/http_api.h"
#include "tests/support/farm/http_fake_farm.h"

namespace sheaf::coordinator {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;

class HttpOperationsTest : public ::testing::Test {
 protected:
  HttpOperationsTest()
      : server_(BuildInfo{"1.2", "abc", "gcc", "profile"}),
        api_(farm_, Actions(), "run", /*access=*/nullptr, &server_),
        router_(api_.Routes(), {}, /*access=*/nullptr, &server_.http_requests) {}

  FarmActions Actions() {
    FarmActions actions;
    actions.list_usage = [this](const UsageQuery& query) -> absl::StatusOr<UsageReport> {
      query_ = query;
      Usage usage = {.result_count = 3, .cpu_duration = absl::Milliseconds(1500)};
      UsageReport report;
      report.sums.push_back({std::nullopt, "anna", "film", "", usage});
      report.stored.push_back({"anna", {.content_bytes = 1, .part_bytes = 2}, 100});
      report.stored.push_back({"ben", {}});
      return report;
    };
    return actions;
  }
  HttpResponse Get(const std::string& target) {
    HttpRequest request;
    request.method = "GET";
    request.target = target;
    request.headers = {{"Host", "localhost"}};
    return router_.Route(request);
  }

  FakeFarm farm_;
  ServerMetrics server_;
  UsageQuery query_;  // The last one.
  HttpApi api_;
  HttpRouter router_;
};

TEST_F(HttpOperationsTest, UsageIsJson) {
  const HttpResponse response =
      Get("/api/v1/usage?by=show&since=1970-01-02&until=1970-01-03&daily=1");
  ASSERT_EQ(response.status, 200) << response.body;
  const json usage = json::parse(response.body);
  EXPECT_EQ(usage["usage"][0]["cpu_seconds"], 1.5);
  EXPECT_EQ(usage["usage"][0]["show"], "film");
  EXPECT_TRUE(usage["usage"][0]["day"].is_null());
  EXPECT_EQ(usage["stored"][0]["total_bytes"], 3);
  EXPECT_EQ(usage["stored"][0]["bytes_max"], 100);
  EXPECT_TRUE(usage["stored"][1]["bytes_max"].is_null()) << "no limit";
  EXPECT_EQ(query_.by, UsageBy::kShow);
  EXPECT_EQ(query_.since_day, 1);
  EXPECT_EQ(query_.until_day, 2);
  EXPECT_TRUE(query_.daily);
  EXPECT_EQ(query_.owner, "") << "without certificates everybody sees all";
}

TEST_F(HttpOperationsTest, UsageIsCsv) {
  const HttpResponse response = Get("/api/v1/usage?format=csv");
  EXPECT_EQ(response.status, 200);
  EXPECT_EQ(response.content_type, "text/csv; charset=utf-8");
  EXPECT_THAT(response.body, ::testing::StartsWith("day,user,show,job,results"));
  EXPECT_THAT(response.body, HasSubstr("\n,anna,film,,3,0,0,1.500"));
}

TEST_F(HttpOperationsTest, WrongQueriesAreRefused) {
  for (const char* query : {"by=scene", "since=today", "daily=yes", "format=xml",
                            "since=1970-01-03&until=1970-01-02"}) {
    EXPECT_EQ(Get(std::string("/api/v1/usage?") + query).status, 400) << query;
  }
}

TEST_F(HttpOperationsTest, MetricsTellOfTheServer) {
  Get("/api/v1/jobs/7");
  Get("/nowhere/7");
  farm_.ready = absl::UnavailableError("the disk");
  const std::string text = Get("/metrics").body;
  for (const char* line :
       {"sheaf_build_info{version=\"1.2\",revision=\"abc\",compiler=\"gcc\","
        "numeric_profile=\"profile\"} 1\n",
        "# TYPE process_cpu_seconds_total counter\n",
        "# TYPE sheaf_http_request_seconds histogram\n",
        "sheaf_http_request_seconds_count{route=\"GET /api/v1/jobs/{}\",code=\"404\"} 1\n",
        "sheaf_http_request_seconds_bucket{route=\"other\",code=\"404\",le=\"+Inf\"} 1\n",
        "sheaf_grpc_call_seconds_count{method=\"WorkerService/Synchronize\",code=\"OK\"} 0\n",
        "sheaf_ready{condition=\"database\"} 0\n", "sheaf_ready{condition=\"disk\"} 1\n"}) {
    EXPECT_THAT(text, HasSubstr(line));
  }
  EXPECT_THAT(text, Not(HasSubstr("nowhere")));
  EXPECT_THAT(Get("/api/v1/counters").body, Not(HasSubstr("sheaf_http_request_seconds")));
}

}  // namespace
}  // namespace sheaf::coordinator
