// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Golden files of the HTTP port: the JSON of each endpoint, the events, and the table of roles with
// the routes.
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "coordinator/access/role_table.h"
#include "coordinator/service/http/api/http_api.h"
#include "coordinator/service/http/api/http_watch.h"
#include "gtest/gtest.h"
#include "tests/golden/golden_file.h"
#include "tests/golden/made_up_views.h"
#include "tests/support/farm/http_fake_farm.h"

namespace sheaf::coordinator {
namespace {

using sheaf::testing::ExpectGolden;

// The same JSON with a value a line.
std::string Spread(const std::string& json) { return nlohmann::ordered_json::parse(json).dump(1); }

class HttpGoldenTest : public ::testing::Test {
 protected:
  HttpGoldenTest() {
    JobView unknown;
    unknown.job_id = "4";
    farm_.jobs = {MadeUpJob(), unknown};
    farm_.workers = {MadeUpWorker(), WorkerView()};
    farm_.workers[1].worker_id = "w-2";
    farm_.failures = {MadeUpFailure(), FailureView()};
    farm_.events = MadeUpEvents();
    farm_.metrics = MadeUpMetrics();
    farm_.prices = MadeUpPrices();
  }

  std::string Answer(const std::string& method, const std::string& target) {
    FarmActions actions;
    actions.collect_garbage = [](bool) { return MadeUpRemovals(); };
    actions.list_usage = [](const UsageQuery&) { return MadeUpUsage(); };
    actions.address = [] { return FarmAddress{7400, true}; };
    HttpApi api(farm_, actions, "run");
    const HttpRouter router(api.Routes(), {});
    HttpRequest request;
    request.method = method;
    request.target = target;
    request.headers = {{"Host", "localhost"}, {kRequestHeader, "1"}};
    const HttpResponse response = router.Route(request);
    return absl::StrCat(method, " ", target, "\n", response.status, " ", response.content_type,
                        "\n", Spread(response.body), "\n\n");
  }

  FakeFarm farm_;
};

TEST_F(HttpGoldenTest, AnswersAreUnchanged) {
  std::string text;
  for (const char* target :
       {"/healthz", "/readyz", "/api/v1/jobs", "/api/v1/jobs?page_size=1", "/api/v1/jobs/5",
        "/api/v1/jobs/5?page_size=1", "/api/v1/jobs/4", "/api/v1/jobs/9", "/api/v1/jobs/5/failures",
        "/api/v1/jobs/5/log", "/api/v1/jobs/5/refine-price?target_error=0.01,0.002",
        "/api/v1/jobs/5/frames/7", "/api/v1/jobs/5/frames/8", "/api/v1/farm", "/api/v1/workers",
        "/api/v1/session", "/api/v1/usage", "/api/v1/counters"}) {
    absl::StrAppend(&text, Answer("GET", target));
  }
  absl::StrAppend(&text, Answer("POST", "/api/v1/gc?dry_run=1"));
  farm_.prices.thread_count = 0;
  farm_.prices.prices[0].wall_seconds.reset();
  farm_.ready = absl::ResourceExhaustedError("the disk is full");
  absl::StrAppend(&text, Answer("GET", "/api/v1/jobs/5/refine-price?target_error=0.01"));
  absl::StrAppend(&text, Answer("GET", "/readyz"));
  ExpectGolden("http_answers.txt", text);
}

TEST_F(HttpGoldenTest, EventsAreUnchanged) {
  EventHub hub;
  FarmDifference difference(&hub);
  const auto reader = *hub.Subscribe("reader");
  difference.Publish(farm_);
  std::string text = reader->Take();
  farm_.jobs[0].frames[0].progress.sample_count_done += 1;
  farm_.jobs[0].progress.sample_count_done += 1;
  difference.Publish(farm_);
  absl::StrAppend(&text, reader->Take());
  farm_.jobs.clear();
  farm_.workers.clear();
  difference.Publish(farm_);
  absl::StrAppend(&text, reader->Take());
  ExpectGolden("http_events.txt", text);
}

TEST_F(HttpGoldenTest, RoutesAreUnchanged) {
  HttpApi api(farm_, {}, "run");
  std::set<std::string> routes;
  for (const HttpRoute& route : api.Routes()) {
    routes.insert(absl::StrCat(route.method, " ", route.pattern, "\n"));
  }
  ExpectGolden("http_routes.txt", absl::StrJoin(routes, ""));
}

TEST(RoleGoldenTest, RolesAreUnchanged) {
  std::map<std::string, std::string> roles;
  for (const OperationRule& rule : RoleTable()) roles[rule.operation] = Describe(rule.requirement);
  std::string text;
  for (const auto& [operation, role] : roles) absl::StrAppend(&text, operation, ": ", role, "\n");
  ExpectGolden("roles.txt", text);
}

}  // namespace
}  // namespace sheaf::coordinator
