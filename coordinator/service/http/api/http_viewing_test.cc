// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Requests for layers, differences, pixels and images in full size, for the address of the farm,
// to delete a job, and to drain a worker.
#include <limits>
#include <string>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/film/denoised_output.h"
#include "coordinator/service/http/api/http_api.h"
#include "gtest/gtest.h"
#include "tests/support/farm/http_fake_farm.h"

namespace sheaf::coordinator {
namespace {

class HttpViewingTest : public ::testing::Test {
 protected:
  HttpViewingTest() : api_(farm_, Actions(), "run"), router_(api_.Routes(), {}) {
    farm_.jobs = {MakeFakeJob("3"), MakeFakeJob("4")};
    farm_.preview.version = 3;
    farm_.preview.image = MakeFakeImage(4, 2, 0.5f);
    farm_.preview.image.planes[0][6] = std::numeric_limits<float>::infinity();
  }
  FarmActions Actions() {
    FarmActions actions;
    actions.read_pixel = [this](const std::string&, int32_t, int32_t x_px, int32_t y_px) {
      return FakePixel(farm_.preview, x_px, y_px);
    };
    actions.change_job = [this](JobVerb verb, const std::string& job_id,
                                const JobArguments&) -> absl::Status {
      if (job_id == "4") return absl::FailedPreconditionError("jobs/4 has not ended");
      if (verb == JobVerb::kDeleteJob) deleted_ = job_id;
      return absl::OkStatus();
    };
    actions.drain_worker = [this](const std::string& worker_id, bool drain) -> absl::Status {
      if (worker_id != "w-1") return absl::NotFoundError("no such worker");
      absl::StrAppend(&drains_, worker_id, drain ? " drained " : " undrained ");
      return absl::OkStatus();
    };
    actions.address = [] { return FarmAddress{7411, true}; };
    return actions;
  }
  HttpResponse Send(const std::string& method, const std::string& target) {
    HttpRequest request;
    request.method = method;
    request.target = absl::StrCat("/api/v1/", target);
    request.headers = {{"Host", "localhost"}, {"X-Sheaf-Request", "1"}};
    return router_.Route(request);
  }
  HttpResponse Preview(const std::string& query) {
    return Send("GET", absl::StrCat("jobs/3/frames/1/preview.png?", query));
  }
  // "LOW HIGH"; empty without.
  static std::string RangeOf(const HttpResponse& response) {
    for (const auto& [name, value] : response.headers) {
      if (name == kRangeHeader) return value;
    }
    return "";
  }
  static bool HasRange(const HttpResponse& response) { return !RangeOf(response).empty(); }

  FakeFarm farm_;
  std::string deleted_;
  std::string drains_;
  HttpApi api_;
  HttpRouter router_;
};

TEST_F(HttpViewingTest, LayersAreListedAndShown) {
  const HttpResponse list = Send("GET", "jobs/3/frames/1/layers");
  EXPECT_EQ(list.status, 200);
  EXPECT_TRUE(absl::StrContains(list.body, R"({"name":"albedo","kind":"color")")) << list.body;
  farm_.preview.image.channel_names[7] = "depth.Z";
  const HttpResponse depth = Preview("layer=image&of=depth");
  EXPECT_EQ(depth.status, 200) << depth.body;
  EXPECT_EQ(depth.body.substr(1, 3), "PNG");
  EXPECT_TRUE(HasRange(depth));
  EXPECT_EQ(Preview("layer=image&of=nothing").status, 404);
  EXPECT_EQ(Preview("layer=samples&of=depth").status, 400);
}

TEST_F(HttpViewingTest, LayersHaveTheChannelsOfTheFile) {
  FilmOutputs* const outputs = &farm_.jobs[0].frames[0].settings.outputs;
  ASSERT_TRUE(AddAovs("object-id", outputs).ok());
  ASSERT_TRUE(AddCryptomattes("object", outputs).ok());
  const HttpResponse list = Send("GET", "jobs/3/frames/1/layers");
  for (const char* part : {R"({"name":"nonfinite","kind":"scalar","channels":["nonfinite.X"]})",
                           R"({"name":"objectId","kind":"id","channels":["objectId.X"]})",
                           R"("channels":["rest.CryptoObject.X"])", R"("channels":["depth.Z"])"}) {
    EXPECT_TRUE(absl::StrContains(list.body, part)) << part << " in " << list.body;
  }
}

TEST_F(HttpViewingTest, DifferencesOfTwoFramesAreShown) {
  for (const char* kind : {"absolute", "relative"}) {
    const HttpResponse difference = Preview(absl::StrCat("with=jobs/4/frames/1&difference=", kind));
    EXPECT_EQ(difference.status, 200) << difference.body;
    EXPECT_TRUE(HasRange(difference));
  }
  EXPECT_EQ(Preview("with=jobs/4/frames/1&difference=other").status, 400);
  EXPECT_EQ(Preview("with=jobs/4&difference=absolute").status, 400);
}

// Regression: a layer and the color of one frame had no difference.
TEST_F(HttpViewingTest, DifferencesOfLayersAreShown) {
  FrameView& frame = farm_.jobs[0].frames[0];
  AddDenoised(&frame.settings.outputs);
  FrameImage& image = farm_.preview.image;
  image = MakeFrameImage({0, 0, 2, 1}, 2, 1, frame.settings.outputs);
  for (const char* channel : {"R", "G", "B"}) {
    *image.Find(channel) = {0.25f, 1};
    *image.Find(absl::StrCat("denoised.", channel)) = {0.5f, 1};
  }
  const std::string with = "with=jobs/3/frames/1&difference=absolute";
  EXPECT_EQ(RangeOf(Preview(with)), "0 0") << "the same image";
  EXPECT_EQ(RangeOf(Preview(with + "&with_of=denoised")), "0.00025 0.25");
  EXPECT_EQ(RangeOf(Preview(with + "&of=denoised&with_of=denoised")), "0 0");
  EXPECT_EQ(Preview(with + "&with_of=depth").status, 400);
  EXPECT_EQ(Preview(with + "&with_of=nothing").status, 404);
}

TEST_F(HttpViewingTest, FalseColorsHaveTheRangeThatAViewerChooses) {
  farm_.preview.image.channel_names[7] = "depth.Z";
  for (const char* query :
       {"layer=error", "layer=samples", "of=depth", "with=jobs/4/frames/1&difference=relative"}) {
    const std::string automatic = Preview(query).body;
    const HttpResponse chosen = Preview(absl::StrCat(query, "&range=0.001,1000"));
    EXPECT_EQ(chosen.status, 200) << chosen.body;
    EXPECT_EQ(RangeOf(chosen), "0.001 1000") << query;
    // The compared images are equal, and have the lowest color in any range.
    if (!absl::StartsWith(query, "with=")) {
      EXPECT_NE(chosen.body, automatic) << query;
    }
  }
  EXPECT_EQ(Preview("layer=error&range=0,1").status, 200) << "a logarithmic scale from 0";
  for (const char* range : {"1", "1,0.5", "1,1", "a,b", "nan,1", "0,inf", "1,2,3"}) {
    EXPECT_EQ(Preview(absl::StrCat("layer=error&range=", range)).status, 400) << range;
  }
}

TEST_F(HttpViewingTest, WorkersAreDrained) {
  farm_.workers.resize(1);
  farm_.workers[0].worker_id = "w-1";
  farm_.workers[0].identity = "worker:node7";
  const HttpResponse drained = Send("POST", "workers/w-1:drain");
  EXPECT_EQ(drained.status, 200) << drained.body;
  EXPECT_TRUE(absl::StrContains(drained.body, R"("identity":"worker:node7")")) << drained.body;
  EXPECT_EQ(drains_, "w-1 drained ");
  EXPECT_EQ(Send("POST", "workers/w-1:undrain").status, 200);
  EXPECT_EQ(drains_, "w-1 drained w-1 undrained ");
  EXPECT_EQ(Send("POST", "workers/w-2:drain").status, 404);
  EXPECT_EQ(Send("GET", "workers/w-1:drain").status, 405);
}

TEST_F(HttpViewingTest, FullSizeNeedsADeliveredImage) {
  EXPECT_EQ(Preview("size=full").status, 409);
  farm_.jobs[0].frames[0].complete = true;
  EXPECT_EQ(Preview("size=full").status, 200);
  EXPECT_EQ(Preview("size=full&layer=error").status, 400);
}

// Regression: a PNG of the page showed the noise, and was white where lights are in candela, while
// sheaf render --png showed the denoised layer, exposed.
TEST_F(HttpViewingTest, ImagesInFullSizeAreThoseOfPngs) {
  FrameView& frame = farm_.jobs[0].frames[0];
  frame.complete = true;
  AddDenoised(&frame.settings.outputs);
  FrameImage& image = farm_.preview.image;
  image = MakeFrameImage({0, 0, 2, 1}, 2, 1, frame.settings.outputs);
  for (const char* channel : {"R", "G", "B"}) {
    *image.Find(channel) = {0.25f, 1000};
    *image.Find(absl::StrCat("denoised.", channel)) = {0.5f, 0.5f};
  }
  const auto png_of = [](float first, float second) {
    FrameImage plain = MakeFrameImage({0, 0, 2, 1}, 2, 1);
    for (const char* channel : {"R", "G", "B"}) *plain.Find(channel) = {first, second};
    const DisplayImage display = *MakeDisplayImage(plain, ImageLayer::kImage, true);
    return *EncodePng(display.width_px, display.height_px, display.pixels);
  };
  EXPECT_EQ(Preview("size=full").body, png_of(0.5f, 0.5f));
  EXPECT_EQ(Preview("size=full&of=denoised").body, png_of(0.5f, 0.5f));
  EXPECT_EQ(Preview("size=full&of=image").body, png_of(0.25f, 1000));
  EXPECT_EQ(Preview("size=full&exposure=-1").body, png_of(0.25f, 0.25f));
  EXPECT_EQ(Preview("size=full&exposure=auto").body, png_of(0.18f, 0.18f));
  EXPECT_EQ(Preview("layer=image&exposure=1").body, png_of(0.5f, 2000));
  EXPECT_EQ(Preview("size=full&exposure=bright").status, 400);
}

TEST_F(HttpViewingTest, PixelsHaveTheValuesOfAllChannels) {
  const HttpResponse pixel = Send("GET", "jobs/3/frames/1/pixel?x=2&y=1");
  EXPECT_EQ(pixel.status, 200) << pixel.body;
  for (const char* part : {R"("version":3)", R"("x":2,"y":1)", R"({"name":"R","value":"inf"})",
                           R"({"name":"G","value":0.5})", R"({"name":"samples","value":16.0})"}) {
    EXPECT_TRUE(absl::StrContains(pixel.body, part)) << part << " in " << pixel.body;
  }
  EXPECT_EQ(Send("GET", "jobs/3/frames/1/pixel?x=4&y=1").status, 400);
  EXPECT_EQ(Send("GET", "jobs/3/frames/1/pixel?x=2").status, 400);
}

TEST_F(HttpViewingTest, JobsAreDeleted) {
  EXPECT_EQ(Send("POST", "jobs/3:delete").status, 200);
  EXPECT_EQ(deleted_, "3");
  EXPECT_EQ(Send("POST", "jobs/4:delete").status, 409);
}

TEST_F(HttpViewingTest, TheAddressOfTheFarmIsTold) {
  EXPECT_EQ(Send("GET", "farm").body, "{\"grpc_port\":7411,\"tls\":true}\n");
}

}  // namespace
}  // namespace sheaf::coordinator
