// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/job/job_check.h"

#include "coordinator/core/job/cell_grid.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;

JobSpec JobOf(int32_t width_px, int32_t height_px, uint64_t samples, int frame_count = 1) {
  JobSpec job;
  for (int i = 1; i <= frame_count; ++i) {
    FrameSpec frame;
    frame.frame_number = i;
    frame.settings.width_px = width_px;
    frame.settings.height_px = height_px;
    frame.settings.window = {0, 0, width_px, height_px};
    frame.settings.samples = samples;
    job.frames.push_back(frame);
  }
  return job;
}

void ExpectRefused(const JobSpec& job, const std::string& why, const std::string& what_to_do) {
  const absl::Status status = CheckJobSpec(job, Limits());
  EXPECT_FALSE(status.ok());
  EXPECT_THAT(std::string(status.message()), HasSubstr(why));
  EXPECT_THAT(std::string(status.message()), HasSubstr(what_to_do));
}

TEST(JobCheckTest, ValidJobsAreAccepted) {
  EXPECT_TRUE(CheckJobSpec(JobOf(16384, 16384, 4096), Limits()).ok());
  EXPECT_TRUE(CheckJobSpec(JobOf(1, 1, uint64_t{1} << 40), Limits()).ok());
  EXPECT_TRUE(CheckJobSpec(JobOf(4096, 2160, 65536, 2000), Limits()).ok());
  JobSpec panorama = JobOf(65536, 65536, 1024);
  panorama.frames[0].settings.window = {0, 0, 8192, 8192};
  EXPECT_TRUE(CheckJobSpec(panorama, Limits()).ok());
}

TEST(JobCheckTest, InvalidJobsAreRefusedWithAReason) {
  ExpectRefused(JobOf(65536, 65536, uint64_t{1} << 40), "4294967296 pixels", "--crop");
  ExpectRefused(JobOf(16384, 16384, uint64_t{1} << 40), "samples each", "request fewer");
  ExpectRefused(JobOf(0, 16, 4), "0 x 16 px", "outside 1 to");
  ExpectRefused(JobOf(16, 16, 4, 100'001), "100001 frames", "several jobs");
  ExpectRefused(JobOf(16, 16, 4, 0), "at least one frame", "");
  JobSpec job = JobOf(1024, 1024, uint64_t{1} << 28, 100);
  job.partition.pass_sample_count = 1 << 16;
  ExpectRefused(job, "frames up to 33", "several jobs");
  job = JobOf(16384, 16384, 4096);
  job.partition.tile_size_px = 4;
  ExpectRefused(job, "tiles of 4 px", "use larger ones");
  job = JobOf(8192, 8192, 65536, 100);
  job.partition = {.tile_size_px = 16, .pass_sample_count = 1, .lease_pass_count = 1};
  ExpectRefused(job, "tasks", "larger tiles");
}

// The frame itself has too many pixels for light passes; a lattice of it has none.
TEST(JobCheckTest, PixelLatticesHaveNoLightPasses) {
  for (const TechniqueSet techniques :
       {TechniqueSet::kCameraAndLight, TechniqueSet::kLight, TechniqueSet::kCameraAndLightGuided}) {
    JobSpec job = JobOf(16384, 16384, 16);
    FrameSettings& settings = job.frames[0].settings;
    settings.techniques = techniques;
    ExpectRefused(job, "light pass of them", "--crop");
    const uint64_t paths = PathsPerSample(settings);
    settings.lattice = {64, 0};
    EXPECT_TRUE(CheckJobSpec(job, Limits()).ok());
    EXPECT_EQ(2 * PathsPerSample(settings), paths);
    EXPECT_FALSE(CellGrid(job.frames[0], job.partition).light_tile().has_value());
  }
}

TEST(JobCheckTest, FramesMustBeUniqueAndSorted) {
  JobSpec job = JobOf(16, 16, 4, 2);
  job.frames[1].frame_number = 1;
  ExpectRefused(job, "frame number 1 is repeated", "");
}

TEST(JobCheckTest, LightPassesHaveLimits) {
  const auto with_light = [](int32_t width_px, int32_t height_px, uint64_t samples) {
    JobSpec job = JobOf(width_px, height_px, samples);
    job.frames[0].settings.techniques = TechniqueSet::kCameraAndLight;
    return job;
  };
  EXPECT_TRUE(CheckJobSpec(with_light(3840, 2160, 4096), Limits()).ok());
  ExpectRefused(with_light(16384, 16384, 16), "light pass of them", "--crop");
  // The bias of merging has twelve planes more.
  JobSpec merged = with_light(3840, 2160, 4096);
  merged.frames[0].settings.techniques =
      TechniqueSet::kCameraAndLight.With(Technique::kMerging);
  EXPECT_TRUE(CheckJobSpec(merged, Limits()).ok());
  Limits limits;
  limits.light_part_bytes_max = uint64_t{480} << 20;
  const std::string refused(CheckJobSpec(merged, limits).message());
  EXPECT_NE(refused.find("can take 761 MiB, more than the limit of 480"), std::string::npos)
      << refused;
  JobSpec guided = with_light(16384, 16384, 16);
  guided.frames[0].settings.techniques = TechniqueSet::kCameraAndLightGuided;
  ExpectRefused(guided, "light pass of them", "--techniques camera+guiding");
  guided.frames[0].settings.techniques = TechniqueSet::kCameraGuided;
  EXPECT_TRUE(CheckJobSpec(guided, Limits()).ok());
  // Light passes of a crop trace the paths of the whole frame.
  JobSpec job = with_light(65536, 65536, uint64_t{1} << 20);
  job.frames[0].settings.window = {0, 0, 16, 16};
  ExpectRefused(job, "samples each", "request fewer");
  job.frames[0].settings.techniques = TechniqueSet::kCamera;
  EXPECT_TRUE(CheckJobSpec(job, Limits()).ok());
}

TEST(JobCheckTest, LargeFramesHaveFewerLightPassesInALease) {
  const auto passes_of = [](int32_t width_px, int32_t height_px) {
    return LightPassesMax(JobOf(width_px, height_px, 16).frames[0].settings, Limits());
  };
  const uint64_t most = Limits().light_pass_count_max;
  EXPECT_EQ(passes_of(64, 64), most);
  EXPECT_GE(passes_of(1920, 1080), 8u);
  EXPECT_GE(passes_of(3840, 2160), 1u);
  EXPECT_LT(passes_of(3840, 2160), most);
  EXPECT_EQ(passes_of(16384, 16384), 0u);
}

TEST(JobCheckTest, StereoFramesHaveLimits) {
  const auto stereo = [](int32_t width_px, int32_t height_px) {
    JobSpec job = JobOf(width_px, height_px, 4096);
    job.frames[0].settings.eye_distance = 0.1f;
    return job;
  };
  EXPECT_TRUE(CheckJobSpec(stereo(1280, 480), Limits()).ok());
  EXPECT_TRUE(CheckJobSpec(stereo(3840, 1080), Limits()).ok());
  ExpectRefused(stereo(7680, 2160), "pixels of both eyes", "render a smaller image");
  ExpectRefused(stereo(639, 480), "both eyes are rendered whole", "");
  JobSpec job = stereo(1280, 480);
  EXPECT_EQ(LightPassesMax(job.frames[0].settings, Limits()), Limits().light_pass_count_max);
  job.frames[0].settings.techniques = TechniqueSet::kLight;
  ExpectRefused(job, "paths from the camera alone", "--techniques camera");
}

TEST(JobCheckTest, FramesOfSharedPathsHaveLimits) {
  const auto shared = [](int32_t width_px, int32_t height_px) {
    JobSpec job = JobOf(width_px, height_px, 4096);
    job.frames[0].settings.techniques = TechniqueSet{Technique::kSharing, Technique::kViews};
    return job;
  };
  EXPECT_TRUE(CheckJobSpec(shared(1920, 1080), Limits()).ok());
  ExpectRefused(shared(7680, 4320), "pixels: a pass of them can take", "render a smaller image");
  JobSpec job = shared(640, 480);
  EXPECT_EQ(LightPassesMax(job.frames[0].settings, Limits()), Limits().light_pass_count_max);
  job.frames[0].settings.window = {0, 0, 320, 240};
  ExpectRefused(job, "is rendered whole", "remove the crop");
  job = shared(640, 480);
  job.frames[0].settings.techniques = job.frames[0].settings.techniques.With(Technique::kGuiding);
  ExpectRefused(job, "not those of the techniques camera+guiding", "camera+sharing+views");
}

// A pass of a crop traces the paths of the whole, or it would not be a part of it.
TEST(JobCheckTest, LightPathsDoNotDependOnTheWindow) {
  FrameSettings settings = JobOf(640, 480, 16).frames[0].settings;
  settings.window = {100, 100, 110, 120};
  EXPECT_EQ(PathsPerLightPass(settings), 640 * 480);
  EXPECT_EQ(PathsPerSample(settings), 200u);
  settings.techniques = TechniqueSet::kLight;
  EXPECT_EQ(PathsPerSample(settings), 640u * 480u + 200u);
  settings.techniques = TechniqueSet::kCameraGuided;
  EXPECT_EQ(PathsPerSample(settings), 200u);
}

}  // namespace
}  // namespace sheaf::coordinator
