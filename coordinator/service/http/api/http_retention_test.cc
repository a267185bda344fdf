// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// HTTP shows and changes how much is kept, and what holds jobs back.
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/service/http/api/http_api.h"
#include "gtest/gtest.h"
#include "tests/support/farm/http_fake_farm.h"

namespace sheaf::coordinator {
namespace {

using nlohmann::json;

class HttpRetentionTest : public ::testing::Test {
 protected:
  HttpRetentionTest() : api_(farm_, Actions(), "run"), router_(api_.Routes(), {}) {
    farm_.jobs = {MakeFakeJob("2"), MakeFakeJob("1")};
  }
  FarmActions Actions() {
    FarmActions actions;
    actions.change_job = [this](JobVerb verb, const std::string& id, const JobArguments&) {
      return SetPinned(id, verb == JobVerb::kPinJob);
    };
    actions.collect_garbage = [this](bool dry_run) -> absl::StatusOr<std::vector<RemovalView>> {
      if (!dry_run) ++collections_;
      return std::vector<RemovalView>{{"parts", "2", "it is older than the limit", 1, 300},
                                      {"blob", "", "no job names it", 3, 50}};
    };
    return actions;
  }
  absl::Status SetPinned(const std::string& job_id, bool pinned) {
    for (JobView& job : farm_.jobs) {
      if (job.job_id == job_id) job.pinned = pinned;
    }
    return farm_.FindJob(job_id).status();
  }
  HttpResponse Send(const std::string& method, const std::string& target) {
    HttpRequest request;
    request.method = method;
    request.target = target;
    request.headers = {{"Host", "localhost"}, {"X-Sheaf-Request", "1"}};
    return router_.Route(request);
  }
  json Read(const std::string& method, const std::string& target) {
    return json::parse(Send(method, target).body);
  }

  FakeFarm farm_;
  int collections_ = 0;
  HttpApi api_;
  HttpRouter router_;
};

TEST_F(HttpRetentionTest, JobsArePinned) {
  EXPECT_EQ(Read("GET", "/api/v1/jobs/2")["pinned"], false);
  EXPECT_EQ(Read("POST", "/api/v1/jobs/2:pin")["pinned"], true);
  EXPECT_EQ(Read("GET", "/api/v1/jobs")["jobs"][0]["pinned"], true);
  EXPECT_EQ(Read("POST", "/api/v1/jobs/2:unpin")["pinned"], false);
  EXPECT_EQ(Send("POST", "/api/v1/jobs/9:pin").status, 404);
}

TEST_F(HttpRetentionTest, JobsSayWhenTheirPartsWent) {
  EXPECT_TRUE(Read("GET", "/api/v1/jobs/2")["parts_removed_time"].is_null());
  farm_.jobs[0].parts_removed_time = absl::FromUnixSeconds(1'700'000'000);
  EXPECT_EQ(Read("GET", "/api/v1/jobs/2")["parts_removed_time"], "2023-11-14T22:13:20.000Z");
}

TEST_F(HttpRetentionTest, GarbageIsListedAndCollected) {
  const json removals = Read("POST", "/api/v1/gc?dry_run=1")["removals"];
  ASSERT_EQ(removals.size(), 2u);
  EXPECT_EQ(removals[0]["job"], "jobs/2");
  EXPECT_EQ(removals[0]["size_bytes"], 300);
  EXPECT_TRUE(removals[1]["job"].is_null());
  EXPECT_EQ(removals[1]["item_count"], 3);
  EXPECT_EQ(Send("POST", "/api/v1/gc?dry_run=yes").status, 400);
  EXPECT_EQ(collections_, 0);
  EXPECT_EQ(Send("POST", "/api/v1/gc").status, 200);
  EXPECT_EQ(collections_, 1);
}

class HttpHoldsTest : public ::testing::Test {
 protected:
  HttpHoldsTest() : api_(farm_, Actions(), "run"), router_(api_.Routes(), {}) {
    farm_.jobs = {MakeFakeJob("2"), MakeFakeJob("1")};
  }
  FarmActions Actions() {
    FarmActions actions;
    actions.change_job = [this](JobVerb verb, const std::string& id,
                                const JobArguments& arguments) -> absl::Status {
      if (verb == JobVerb::kReleaseJob) {
        released_.push_back(id);
        return absl::OkStatus();
      }
      approved_.emplace_back(id, arguments.frames);
      return id == "1" ? absl::FailedPreconditionError("does not wait") : absl::OkStatus();
    };
    return actions;
  }
  HttpResponse Send(const std::string& method, const std::string& target) {
    HttpRequest request;
    request.method = method;
    request.target = target;
    request.headers = {{"Host", "localhost"}, {"X-Sheaf-Request", "1"}};
    return router_.Route(request);
  }

  FakeFarm farm_;
  std::vector<std::string> released_;
  std::vector<std::pair<std::string, std::vector<int32_t>>> approved_;
  HttpApi api_;
  HttpRouter router_;
};

TEST_F(HttpHoldsTest, ShowsWhatAJobWaitsFor) {
  farm_.jobs[0].dependencies = {{"1", true, "has failed"}};
  farm_.jobs[0].unapproved_frame_count = 3;
  const json job = json::parse(Send("GET", "/api/v1/jobs/2").body);
  EXPECT_EQ(job["unapproved_frame_count"], 3);
  EXPECT_EQ(job["dependencies"][0]["job_name"], "jobs/1");
  EXPECT_EQ(job["dependencies"][0]["by_frame"], true);
  EXPECT_EQ(job["dependencies"][0]["state"], "has failed");
  EXPECT_TRUE(json::parse(Send("GET", "/api/v1/jobs/1").body)["dependencies"].empty());
}

TEST_F(HttpHoldsTest, ReleasesAndApproves) {
  EXPECT_EQ(Send("POST", "/api/v1/jobs/2:release").status, 200);
  EXPECT_EQ(released_, std::vector<std::string>{"2"});
  EXPECT_EQ(Send("POST", "/api/v1/jobs/2:approve").status, 200);
  EXPECT_EQ(Send("POST", "/api/v1/jobs/2:approve?frames=3,-5").status, 200);
  ASSERT_EQ(approved_.size(), 2u);
  EXPECT_TRUE(approved_[0].second.empty());
  EXPECT_EQ(approved_[1].second, (std::vector<int32_t>{3, -5}));
  EXPECT_EQ(Send("POST", "/api/v1/jobs/2:approve?frames=3-5").status, 400);
  EXPECT_EQ(approved_.size(), 2u);
  EXPECT_GE(Send("POST", "/api/v1/jobs/1:approve").status, 400);
}

}  // namespace
}  // namespace sheaf::coordinator
