// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/http/api/http_api.h"

#include <map>
#include <nlohmann/json.hpp>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/support/farm/http_fake_farm.h"

namespace sheaf::coordinator {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

class HttpApiTest : public ::testing::Test {
 protected:
  HttpApiTest() : api_(farm_, Actions(), "run"), router_(api_.Routes(), {}) {
    farm_.jobs = {MakeFakeJob("3"), MakeFakeJob("2"), MakeFakeJob("1")};
    farm_.preview.version = 3;
    farm_.preview.image = MakeFakeImage(4, 2, 0.5f);
  }

  FarmActions Actions() {
    FarmActions actions;
    actions.change_job = [this](JobVerb verb, const std::string& id,
                                const JobArguments& arguments) -> absl::Status {
      if (verb == JobVerb::kCancelJob) return Set(id, JobState::kCancelled);
      if (verb == JobVerb::kPauseJob) return Set(id, JobState::kPaused);
      if (verb == JobVerb::kSetJobPriority) farm_.jobs[0].priority = arguments.priority;
      if (verb == JobVerb::kRefineJob) {
        if (id == "2") return absl::FailedPreconditionError("jobs/2 is not finished yet");
        refinement_ = arguments.refinement;
      }
      return Set(id, JobState::kRunning);
    };
    return actions;
  }
  absl::Status Set(const std::string& job_id, JobState state) {
    for (JobView& job : farm_.jobs) {
      if (job.job_id != job_id) continue;
      job.state = state;
      return absl::OkStatus();
    }
    return absl::NotFoundError("no job jobs/" + job_id);
  }

  HttpResponse Send(const std::string& method, const std::string& target,
                    const std::string& etag = "") {
    HttpRequest request;
    request.method = method;
    request.target = target;
    request.headers = {{"Host", "localhost"}, {"X-Sheaf-Request", "1"}, {"If-None-Match", etag}};
    return router_.Route(request);
  }
  json Get(const std::string& target) { return json::parse(Send("GET", target).body); }

  FakeFarm farm_;
  Refinement refinement_;  // The last requested one.
  HttpApi api_;
  HttpRouter router_;
};

std::string Header(const HttpResponse& response, const std::string& name) {
  for (const auto& [key, value] : response.headers) {
    if (key == name) return value;
  }
  return "";
}

TEST_F(HttpApiTest, ProbesAndMetricsAreProbes) {
  const auto is_probe = [this](const std::string& target) {
    HttpRequest request;
    request.target = target;
    return router_.IsProbe(request);
  };
  for (const char* path : {"/healthz", "/readyz", "/metrics", "/metrics?x=1"}) {
    EXPECT_TRUE(is_probe(path)) << path;
  }
  EXPECT_FALSE(is_probe("/api/v1/jobs"));
}

TEST_F(HttpApiTest, ReadinessReportsTheReason) {
  EXPECT_EQ(Get("/healthz")["healthy"], true);
  EXPECT_EQ(Send("GET", "/readyz").status, 200);
  EXPECT_EQ(Get("/readyz")["ready"], true);
  farm_.ready = absl::ResourceExhaustedError("state/: No space left on device");
  const HttpResponse response = Send("GET", "/readyz");
  EXPECT_EQ(response.status, 503);
  const json state = json::parse(response.body);
  EXPECT_EQ(state["ready"], false);
  EXPECT_EQ(state["conditions"][0]["name"], "database");
  EXPECT_EQ(state["conditions"][0]["ok"], false);
  EXPECT_EQ(state["conditions"][0]["reason"], "state/: No space left on device");
  EXPECT_EQ(state["conditions"][1]["ok"], true);
}

TEST_F(HttpApiTest, JobPagesSurviveNewJobs) {
  const json first = Get("/api/v1/jobs?page_size=2");
  EXPECT_EQ(first["jobs"].size(), 2u);
  EXPECT_EQ(first["jobs"][0]["name"], "jobs/3");
  farm_.jobs.insert(farm_.jobs.begin(), MakeFakeJob("4"));
  const json second =
      Get("/api/v1/jobs?page_size=2&page_token=" + first["next_page_token"].get<std::string>());
  EXPECT_EQ(second["jobs"].size(), 1u);
  EXPECT_EQ(second["jobs"][0]["name"], "jobs/1");
  EXPECT_EQ(second["next_page_token"], "");
}

TEST_F(HttpApiTest, BadPagesAreRefused) {
  for (const char* query : {"page_size=0", "page_size=1001", "page_size=x", "page_token=nine"}) {
    const HttpResponse response = Send("GET", std::string("/api/v1/jobs?") + query);
    EXPECT_EQ(response.status, 400) << query;
    EXPECT_EQ(json::parse(response.body)["error"]["code"], "INVALID_ARGUMENT");
  }
}

TEST_F(HttpApiTest, JobTimesAreIsoOrNull) {
  const json job = Get("/api/v1/jobs/1");
  EXPECT_EQ(job["create_time"], "2023-11-14T22:13:20.123Z");
  EXPECT_TRUE(job["end_time"].is_null());
  EXPECT_TRUE(job["progress"]["relative_mse"].is_null());
  EXPECT_TRUE(job["progress"]["remaining_duration_seconds"].is_null());
  EXPECT_EQ(job["state"], "running");
  EXPECT_EQ(job["frames"][0]["sample_count"], 16);
  EXPECT_EQ(job["frames"][0]["similarity_after_count"], 8);
  EXPECT_EQ(job["frames"][0]["techniques"], "camera+light");
  EXPECT_EQ(job["frames"][0]["window"]["x1_px"], 4);
}

TEST_F(HttpApiTest, JobsNameTheMostActiveFrame) {
  const json shown = Get("/api/v1/jobs")["jobs"][0]["preview_frame"];
  EXPECT_EQ(shown["name"], "jobs/3/frames/1");
  EXPECT_EQ(shown["preview_version"], 3);
  EXPECT_EQ(shown["complete"], false);
  farm_.jobs[0].preview_frame.reset();
  EXPECT_TRUE(Get("/api/v1/jobs")["jobs"][0]["preview_frame"].is_null());
  // The preview frame is the first one that is started but not complete, or else the last complete
  // one.
  FrameView frame;
  const auto shown_after = [&](int32_t number, uint64_t version, bool complete) {
    frame.frame_number = number;
    frame.preview_version = version;
    frame.complete = complete;
    NotePreviewFrame(frame, &farm_.jobs[0]);
    return farm_.jobs[0].preview_frame.value_or(PreviewFrame()).name;
  };
  EXPECT_EQ(shown_after(1, 0, false), "");
  EXPECT_EQ(shown_after(2, 9, true), "jobs/3/frames/2");
  EXPECT_EQ(shown_after(3, 9, true), "jobs/3/frames/3");
  EXPECT_EQ(shown_after(4, 5, false), "jobs/3/frames/4");
  EXPECT_EQ(shown_after(5, 5, false), "jobs/3/frames/4");
  EXPECT_EQ(shown_after(6, 9, true), "jobs/3/frames/4");
}

TEST_F(HttpApiTest, FramesArePaged) {
  FrameView frame = farm_.jobs[2].frames[0];
  for (int32_t number = 2; number <= 5; ++number) {
    frame.frame_number = number;
    farm_.jobs[2].frames.push_back(frame);
  }
  const json first = Get("/api/v1/jobs/1?page_size=3");
  EXPECT_EQ(first["frames"].size(), 3u);
  EXPECT_EQ(first["next_page_token"], "3");
  const json second = Get("/api/v1/jobs/1?page_size=3&page_token=3");
  EXPECT_EQ(second["frames"].size(), 2u);
  EXPECT_EQ(second["frames"][0]["frame_number"], 4);
  EXPECT_EQ(second["next_page_token"], "");
}

TEST_F(HttpApiTest, UnknownFrameValuesAreNull) {
  FrameView& frame = farm_.jobs[2].frames[0];
  EXPECT_TRUE(Get("/api/v1/jobs/1/frames/1")["flip"].is_null());
  EXPECT_TRUE(Get("/api/v1/jobs/1/frames/1")["one_sequence_gain"].is_null());
  frame.flip = 0.25;
  frame.one_sequence_gain = 1.5;
  EXPECT_EQ(Get("/api/v1/jobs/1/frames/1")["flip"], 0.25);
  EXPECT_EQ(Get("/api/v1/jobs/1/frames/1")["one_sequence_gain"], 1.5);
}

TEST_F(HttpApiTest, UnknownNamesAreNotFound) {
  EXPECT_EQ(Send("GET", "/api/v1/jobs/9").status, 404);
  EXPECT_EQ(Send("GET", "/api/v1/jobs/1/frames/9").status, 404);
  EXPECT_EQ(Send("GET", "/api/v1/jobs/1/frames/x").status, 400);
  EXPECT_EQ(Send("POST", "/api/v1/jobs/9:cancel").status, 404);
}

TEST_F(HttpApiTest, CancelReturnsTheJob) {
  const HttpResponse response = Send("POST", "/api/v1/jobs/2:cancel");
  EXPECT_EQ(response.status, 200);
  EXPECT_EQ(json::parse(response.body)["state"], "cancelled");
}

TEST_F(HttpApiTest, JobsArePausedResumedAndPromoted) {
  EXPECT_EQ(json::parse(Send("POST", "/api/v1/jobs/2:pause").body)["state"], "paused");
  EXPECT_EQ(json::parse(Send("POST", "/api/v1/jobs/2:resume").body)["state"], "running");
  EXPECT_EQ(json::parse(Send("POST", "/api/v1/jobs/3:priority?value=-7").body)["priority"], -7);
  EXPECT_EQ(Send("POST", "/api/v1/jobs/9:pause").status, 404);
  for (const char* wrong : {"", "?value=", "?value=high", "?value=1.5"}) {
    EXPECT_EQ(Send("POST", std::string("/api/v1/jobs/3:priority") + wrong).status, 400) << wrong;
  }
}

TEST_F(HttpApiTest, WorkersArePaged) {
  for (const char* id : {"a", "b", "c"}) farm_.workers.emplace_back().worker_id = id;
  EXPECT_EQ(Get("/api/v1/workers")["workers"].size(), 3u);
  const json first = Get("/api/v1/workers?page_size=2");
  ASSERT_EQ(first["workers"].size(), 2u);
  EXPECT_EQ(first["next_page_token"], "b");
  const json second = Get("/api/v1/workers?page_size=2&page_token=b");
  ASSERT_EQ(second["workers"].size(), 1u);
  EXPECT_EQ(second["workers"][0]["name"], "workers/c");
  EXPECT_EQ(second["next_page_token"], "");
  EXPECT_EQ(Send("GET", "/api/v1/workers?page_size=0").status, 400);
}

TEST_F(HttpApiTest, FinishedJobsAreRefined) {
  const std::string refine = "/api/v1/jobs/3:refine";
  EXPECT_EQ(json::parse(Send("POST", refine + "?target_error=1e-3").body)["state"], "running");
  EXPECT_EQ(refinement_.stop.target_error, 1e-3);
  EXPECT_EQ(refinement_.samples, kStoppedSamplesMax);
  EXPECT_EQ(Send("POST", refine + "?samples=512").status, 200);
  EXPECT_FALSE(refinement_.stop.IsActive());
  EXPECT_EQ(refinement_.samples, 512u);
  EXPECT_EQ(Send("POST", refine + "?target_error=0.01&samples=99").status, 200);
  EXPECT_EQ(refinement_.samples, 99u);
  for (const char* wrong :
       {"", "?target_error=", "?target_error=good", "?target_error=0", "?target_error=-1",
        "?target_error=nan", "?target_error=1e7", "?samples=0", "?samples=-4", "?samples=many"}) {
    EXPECT_EQ(Send("POST", refine + wrong).status, 400) << wrong;
  }
  EXPECT_EQ(Send("POST", "/api/v1/jobs/9:refine?samples=64").status, 404);
  const HttpResponse unfinished = Send("POST", "/api/v1/jobs/2:refine?samples=64");
  EXPECT_EQ(unfinished.status, 409);
  EXPECT_NE(unfinished.body.find("not finished"), std::string::npos);
}

TEST_F(HttpApiTest, RefinementsArePriced) {
  farm_.prices.thread_count = 6;
  const std::string price = "/api/v1/jobs/3/refine-price";
  const json priced = Get(price + "?target_error=1e-3,5e-4");
  ASSERT_EQ(priced["prices"].size(), 2u);
  EXPECT_EQ(priced["prices"][1]["target_error"], 5e-4);
  EXPECT_EQ(priced["prices"][1]["cpu_seconds"]["value"], 2);
  EXPECT_EQ(priced["prices"][1]["wall_seconds"]["value"], 1);
  EXPECT_LT(priced["prices"][1]["cpu_seconds"]["low"], priced["prices"][1]["cpu_seconds"]["high"]);
  EXPECT_EQ(priced["thread_count"], 6);
  EXPECT_EQ(priced["jobs_before_count"], 0);
  farm_.prices.thread_count = 0;
  EXPECT_TRUE(Get(price + "?target_error=1")["prices"][0]["wall_seconds"].is_null());
  for (const char* wrong : {"", "?target_error=", "?target_error=1,", "?target_error=1,x"}) {
    EXPECT_EQ(Send("GET", price + wrong).status, 400) << wrong;
  }
  EXPECT_EQ(Send("GET", "/api/v1/jobs/9/refine-price?target_error=1").status, 404);
}

TEST_F(HttpApiTest, OnlySingleJobsIncludeEffects) {
  farm_.jobs[0].effect_costs = {{"lens", "", "a pinhole", 0.25, 0.01, -0.5, 0.03, 1e-4, 1.5}};
  const json effect = Get("/api/v1/jobs/3")["effect_costs"][0];
  EXPECT_EQ(effect["name"], "lens");
  EXPECT_EQ(effect["time_fraction"], 0.25);
  EXPECT_EQ(effect["mean_change"], -0.5);
  EXPECT_EQ(effect["variance_ratio"], 1.5);
  EXPECT_TRUE(Get("/api/v1/jobs/2")["effect_costs"].empty());
  EXPECT_FALSE(Get("/api/v1/jobs")["jobs"][0].contains("effect_costs"));
}

TEST_F(HttpApiTest, FailuresIncludeTheirRenderCommand) {
  FailureRecord failure;
  failure.frame_number = 1;
  failure.tile = {0, 0, 4, 2};
  failure.block = {16, 16};
  failure.worker_id = "w";
  failure.kind = FailureKind::kMemory;
  failure.message = "too large";
  farm_.failures = {{failure, "sheaf render a.pbrt"}};
  farm_.jobs[0].failure_count = 1;
  EXPECT_EQ(Get("/api/v1/jobs/3")["failure_count"], 1);
  const json list = Get("/api/v1/jobs/3/failures")["failures"];
  ASSERT_EQ(list.size(), 1u);
  EXPECT_EQ(list[0]["frame_name"], "jobs/3/frames/1");
  EXPECT_EQ(list[0]["kind"], "memory");
  EXPECT_EQ(list[0]["tile"]["x1_px"], 4);
  EXPECT_EQ(list[0]["first_sample"], 16);
  EXPECT_EQ(list[0]["command"], "sheaf render a.pbrt");
  EXPECT_EQ(Send("GET", "/api/v1/jobs/9/failures").status, 404);
}

TEST_F(HttpApiTest, WorkersReportTheirState) {
  WorkerView worker;
  worker.worker_id = "w";
  worker.leases = {{{3, 1}, {0, 0, 2, 2}, {0, 8}, LeasePhase::kRendering, absl::UnixEpoch()}};
  worker.warm_scenes = {"room.pbrt"};
  worker.warm_scene_count = 1;
  farm_.workers = {worker};
  json shown = Get("/api/v1/workers")["workers"][0];
  EXPECT_EQ(shown["leases"][0]["frame_name"], "jobs/3/frames/1");
  EXPECT_EQ(shown["leases"][0]["phase"], "rendering");
  EXPECT_EQ(shown["warm_scenes"], json({"room.pbrt"}));
  EXPECT_TRUE(shown["scene_memory_bytes"].is_null());
  farm_.workers[0].scene_memory_bytes = 4096;
  EXPECT_EQ(Get("/api/v1/workers")["workers"][0]["scene_memory_bytes"], 4096);
}

TEST_F(HttpApiTest, PreviewIsACachedPng) {
  const std::string path = "/api/v1/jobs/1/frames/1/preview.png";
  const HttpResponse first = Send("GET", path);
  EXPECT_EQ(first.content_type, "image/png");
  EXPECT_EQ(first.body.substr(1, 3), "PNG");
  EXPECT_EQ(Header(first, "ETag"), "\"run-3\"");
  const HttpResponse second = Send("GET", path, "\"run-3\"");
  EXPECT_EQ(second.status, 304);
  EXPECT_EQ(second.body, "");
}

TEST_F(HttpApiTest, PreviewLayersHaveRanges) {
  const std::string path = "/api/v1/jobs/1/frames/1/preview.png";
  EXPECT_EQ(Header(Send("GET", path + "?layer=image"), "X-Sheaf-Range"), "");
  EXPECT_EQ(Header(Send("GET", path + "?layer=samples"), "X-Sheaf-Range"), "16 16");
  const HttpResponse error = Send("GET", path + "?version=3&layer=error");
  EXPECT_EQ(error.body.substr(1, 3), "PNG");
  EXPECT_EQ(Header(error, "X-Sheaf-Range"), "0.05 0.1");
  const HttpResponse unknown = Send("GET", path + "?layer=depth");
  EXPECT_EQ(unknown.status, 400);
  EXPECT_THAT(unknown.body, HasSubstr("not one of image, light, error, samples"));
  EXPECT_EQ(Send("GET", "/api/v1/false-color.png").content_type, "image/png");
}

TEST_F(HttpApiTest, ThumbnailsAreSmall) {
  farm_.preview.image = MakeFakeImage(400, 200, 0.5f);
  const std::string path = "/api/v1/jobs/2/frames/1/preview.png";
  const HttpResponse small = Send("GET", path + "?size=thumbnail");
  EXPECT_EQ(small.status, 200);
  EXPECT_LT(small.body.size(), Send("GET", path).body.size());
  // Width and height follow the PNG's signature and its first chunk's head.
  EXPECT_EQ(small.body.substr(16, 8), std::string("\0\0\0\x85\0\0\0\x42", 8));
  EXPECT_EQ(Send("GET", path + "?size=huge").status, 400);
  EXPECT_EQ(Send("GET", path + "?size=thumbnail&layer=error").status, 400);
}

TEST_F(HttpApiTest, RoundsHavePreviews) {
  farm_.jobs[1].frames[0].rounds.resize(2);
  farm_.jobs[1].frames[0].rounds[1].preview_version = 7;
  farm_.round_preview.image = MakeFakeImage(2, 1, 0.25f);
  const std::string path = "/api/v1/jobs/2/frames/1/preview.png?layer=";
  const HttpResponse round = Send("GET", path + "samples&round=1");
  EXPECT_EQ(round.status, 200);
  EXPECT_EQ(Header(round, "X-Sheaf-Range"), "16 16");
  EXPECT_EQ(Header(round, "ETag"), "\"run-7\"");
  EXPECT_EQ(Send("GET", path + "samples&round=1", "\"run-7\"").status, 304);
  EXPECT_NE(Send("GET", path + "&round=1").body, Send("GET", path).body);
  EXPECT_EQ(Send("GET", path + "&round=0").status, 404) << "not kept";
  EXPECT_EQ(Send("GET", path + "&round=2").status, 404);
  for (const char* wrong : {"-1", "x", "1&size=thumbnail"}) {
    EXPECT_EQ(Send("GET", path + "&round=" + wrong).status, 400) << wrong;
  }
  EXPECT_EQ(Get("/api/v1/jobs/2/frames/1")["rounds"][1]["preview_version"], 7);
}

TEST_F(HttpApiTest, PreviewWithoutSamplesIsEmpty) {
  farm_.preview.version = 0;
  const HttpResponse response = Send("GET", "/api/v1/jobs/1/frames/1/preview.png");
  EXPECT_EQ(response.status, 204);
  EXPECT_EQ(response.body, "");
  // If an existing image cannot be delivered, the response is an error.
  farm_.jobs[2].frames[0].complete = true;
  EXPECT_EQ(Send("GET", "/api/v1/jobs/1/frames/1/preview.png").status, 503);
  // A list may still ask for the thumbnail of a job that is gone.
  EXPECT_EQ(Send("GET", "/api/v1/jobs/9/frames/1/preview.png?size=thumbnail").status, 204);
  EXPECT_EQ(Send("GET", "/api/v1/jobs/9/frames/1/preview.png").status, 404);
}

TEST_F(HttpApiTest, OutputIsAvailableOnceComplete) {
  const std::string path = "/api/v1/jobs/1/frames/1/output.exr";
  EXPECT_EQ(Send("GET", path).status, 409);
  FrameView& frame = farm_.jobs[2].frames[0];
  frame.complete = true;
  frame.output_path = "/state/out.exr";
  frame.image_digest = "abc";
  farm_.jobs[2].title = "../a \"b\"\r\n";
  const HttpResponse response = Send("GET", path);
  EXPECT_EQ(response.file_path, "/state/out.exr");
  EXPECT_EQ(Header(response, "Content-Disposition"),
            "attachment; filename=\".._a__b___.0001.exr\"");
}

TEST_F(HttpApiTest, MetricsFollowTheTextFormat) {
  farm_.metrics = {
      {"sheaf_a_total", "Help with \\ and\nnewline.", MetricView::Kind::kCounter, "", "", 3},
      {"sheaf_b", "B.", MetricView::Kind::kGauge, "state", "a\"b\\c\nd", 0.5},
      {"sheaf_b", "B.", MetricView::Kind::kGauge, "state", "x", 1}};
  const HttpResponse response = Send("GET", "/metrics");
  EXPECT_EQ(response.content_type, "text/plain; version=0.0.4; charset=utf-8");
  EXPECT_THAT(
      response.body,
      ::testing::StartsWith(
          "# HELP sheaf_a_total Help with \\\\ and\\nnewline.\n# TYPE sheaf_a_total counter\n"
          "sheaf_a_total 3\n# HELP sheaf_b B.\n# TYPE sheaf_b gauge\n"
          "sheaf_b{state=\"a\\\"b\\\\c\\nd\"} 0.5\nsheaf_b{state=\"x\"} 1\n"));
  EXPECT_EQ(Get("/api/v1/counters")["counters"][0]["value"], 3.0);
}

}  // namespace
}  // namespace sheaf::coordinator
