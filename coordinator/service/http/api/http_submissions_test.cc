// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/http/api/http_submissions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"

namespace sheaf::coordinator {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

// Notes what it is asked for.
class FakeDesk : public SubmissionDesk {
 public:
  SubmissionOffer Offer() const override { return {"", 100, 10, 50}; }
  absl::StatusOr<SubmissionView> Begin(const SubmissionCaller& caller) override {
    asked = absl::StrCat("begin ", caller.owner, ", ", caller.who);
    return view;
  }
  absl::StatusOr<uint64_t> Append(const SubmissionCaller&, const std::string& id,
                                  const std::string& name, uint64_t offset_bytes,
                                  std::string_view bytes) override {
    asked = absl::StrCat("append ", id, ", ", name, ", ", offset_bytes, ", ", std::string(bytes));
    if (name == "..") return absl::InvalidArgumentError("refused");
    return offset_bytes + bytes.size();
  }
  absl::StatusOr<SubmissionView> Read(const SubmissionCaller&, const std::string& id,
                                      const SubmissionWish& wish) override {
    asked = absl::StrCat("read ", id, ", ", wish.scene, ", ", wish.title, ", ", wish.samples, ", ",
                         wish.target_error);
    return view;
  }
  absl::StatusOr<SubmissionView> Find(const SubmissionCaller&, const std::string&) const override {
    return view;
  }
  absl::Status Discard(const SubmissionCaller&, const std::string& id) override {
    asked = "discard " + id;
    return absl::OkStatus();
  }

  std::string asked;
  SubmissionView view{"3", SubmissionState::kReceiving, 2, 40, {}, "", ""};
};

class HttpSubmissionsTest : public ::testing::Test {
 protected:
  HttpResponse Send(const std::string& method, const std::string& target,
                    const std::string& body = "") {
    return Route(router_, method, target, body);
  }
  static HttpResponse Route(const HttpRouter& router, const std::string& method,
                            const std::string& target, const std::string& body) {
    HttpRequest request;
    request.method = method;
    request.target = target;
    request.peer = "127.0.0.1";
    request.headers = {{"Host", "localhost"}, {"X-Sheaf-Request", "1"}};
    request.body = body;
    return router.Route(request);
  }
  FakeDesk desk_;
  HttpSubmissions submissions_{&desk_};
  HttpRouter router_{submissions_.Routes(), {}};
};

TEST_F(HttpSubmissionsTest, StatesAreJson) {
  const json offer = json::parse(Send("GET", "/api/v1/submissions").body);
  EXPECT_EQ(offer, json::parse(R"({"why_not": "", "bytes_max": 100, "files_max": 10,
                                   "piece_bytes_max": 50})"));
  json view = json::parse(Send("POST", "/api/v1/submissions").body);
  EXPECT_EQ(desk_.asked, "begin local, local at 127.0.0.1");
  EXPECT_EQ(view, json::parse(R"({"name": "submissions/3", "state": "receiving", "file_count": 2,
      "received_bytes": 40, "scenes": [], "messages": "", "job": null})"));
  desk_.view.state = SubmissionState::kSubmitted;
  desk_.view.job_id = "7";
  desk_.view.messages = "a note";
  view = json::parse(Send("GET", "/api/v1/submissions/3").body);
  EXPECT_EQ(view["state"], "submitted");
  EXPECT_EQ(view["job"], "jobs/7");
  EXPECT_EQ(view["messages"], "a note");
}

TEST_F(HttpSubmissionsTest, PiecesAndWishesArriveAsSent) {
  const std::string body("a\0b", 3);
  const HttpResponse piece =
      Send("POST", "/api/v1/submissions/3/files?name=shot%2Fa%20b.pbrt&offset=5", body);
  EXPECT_EQ(json::parse(piece.body)["size_bytes"], 8);
  EXPECT_EQ(desk_.asked, absl::StrCat("append 3, shot/a b.pbrt, 5, ", body));
  Send("POST", "/api/v1/submissions/3:read?scene=b.pbrt&title=T&samples=16&target_error=0.5");
  EXPECT_EQ(desk_.asked, "read 3, b.pbrt, T, 16, 0.5");
  Send("POST", "/api/v1/submissions/3:read");
  EXPECT_EQ(desk_.asked, "read 3, , , 0, 0");
  EXPECT_EQ(Send("POST", "/api/v1/submissions/3:discard").status, 200);
  EXPECT_EQ(desk_.asked, "discard 3");
}

TEST_F(HttpSubmissionsTest, WhatIsWrongIsRefused) {
  EXPECT_EQ(Send("POST", "/api/v1/submissions/3/files?name=..").status, 400);
  EXPECT_EQ(Send("POST", "/api/v1/submissions/3/files?name=a&offset=-1").status, 400);
  for (const char* query : {"samples=x", "samples=-1", "target_error=x", "target_error=nan",
                            "target_error=-1", "target_error=inf"}) {
    const HttpResponse response = Send("POST", absl::StrCat("/api/v1/submissions/3:read?", query));
    EXPECT_EQ(response.status, 400) << query;
  }
}

TEST_F(HttpSubmissionsTest, WithoutADeskNothingIsTaken) {
  const HttpSubmissions none(nullptr);
  const HttpRouter router(none.Routes(), {});
  EXPECT_THAT(Route(router, "GET", "/api/v1/submissions", "").body, HasSubstr("takes no dropped"));
  EXPECT_EQ(Route(router, "POST", "/api/v1/submissions", "").status, 409);
  EXPECT_EQ(Route(router, "GET", "/api/v1/submissions/1", "").status, 404);
}

TEST_F(HttpSubmissionsTest, LargeBodiesAreForPiecesOfCallersWhoAreLetIn) {
  HttpRequest head;
  head.method = "POST";
  head.target = "/api/v1/submissions/3/files?name=a";
  head.headers = {{"Host", "localhost"}, {"X-Sheaf-Request", "1"}};
  HttpResponse refusal;
  EXPECT_TRUE(router_.AdmitsLargeBody(head, kHttpLargeBodyBytesMax, &refusal));
  EXPECT_FALSE(router_.AdmitsLargeBody(head, kHttpLargeBodyBytesMax + 1, &refusal));
  EXPECT_EQ(refusal.status, 413);
  head.headers.pop_back();
  EXPECT_FALSE(router_.AdmitsLargeBody(head, kHttpLargeBodyBytesMax, &refusal));
  EXPECT_EQ(refusal.status, 403) << "another site";
  head.target = "/api/v1/submissions/3:read";
  EXPECT_FALSE(router_.AdmitsLargeBody(head, kHttpLargeBodyBytesMax, &refusal));
  EXPECT_EQ(refusal.status, 413);
}

}  // namespace
}  // namespace sheaf::coordinator
