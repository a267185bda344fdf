// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Requests to try failed work again, or to give it up.
#include <optional>
#include <string>

#include "absl/strings/str_cat.h"
#include "coordinator/service/http/api/http_api.h"
#include "gtest/gtest.h"
#include "tests/support/farm/http_fake_farm.h"

namespace sheaf::coordinator {
namespace {

class HttpRetryTest : public ::testing::Test {
 protected:
  HttpRetryTest() : api_(farm_, Actions(), "run"), router_(api_.Routes(), {}) {
    farm_.jobs = {MakeFakeJob("3")};
  }
  FarmActions Actions() {
    FarmActions actions;
    actions.change_job = [this](JobVerb verb, const std::string& job,
                                const JobArguments& arguments) {
      asked_ = absl::StrCat(RowOf(verb).word, " ", job, " ", arguments.frame.value_or(-1), " ",
                            arguments.task.value_or(99), " ", arguments.user);
      return absl::OkStatus();
    };
    return actions;
  }
  int Post(const std::string& target) {
    HttpRequest request;
    request.method = "POST";
    request.target = "/api/v1/jobs/3:" + target;
    request.headers = {{"Host", "localhost"}, {"X-Sheaf-Request", "1"}};
    return router_.Route(request).status;
  }

  FakeFarm farm_;
  std::string asked_;
  HttpApi api_;
  HttpRouter router_;
};

TEST_F(HttpRetryTest, JobsFramesAndTasksAreRetried) {
  EXPECT_EQ(Post("retry"), 200);
  EXPECT_EQ(asked_, "retry 3 -1 99 local");
  EXPECT_EQ(Post("retry?frame=-7&task=4"), 200);
  EXPECT_EQ(asked_, "retry 3 -7 4 local");
}

TEST_F(HttpRetryTest, FramesAndTasksAreKilled) {
  EXPECT_EQ(Post("kill?frame=2"), 200);
  EXPECT_EQ(asked_, "kill 3 2 99 local");
  EXPECT_EQ(Post("kill?frame=2&task=0"), 200);
  EXPECT_EQ(asked_, "kill 3 2 0 local");
}

TEST_F(HttpRetryTest, WrongRequestsAreRefused) {
  for (const char* wrong :
       {"kill", "kill?task=1", "retry?task=1", "retry?frame=x", "retry?frame=1&task=-1"}) {
    EXPECT_EQ(Post(wrong), 400) << wrong;
  }
  EXPECT_EQ(asked_, "");
}

}  // namespace
}  // namespace sheaf::coordinator
