// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/prepared_job.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fcntl.h>
#include <semaphore.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <optional>
#include <thread>

#include "absl/strings/match.h"
#include "absl/strings/str_join.h"

namespace sheaf::cli {
namespace {

using ::testing::HasSubstr;

class PreparedJobTest : public ::testing::Test {
 protected:
  void SetUp() override {
    directory_ = ::testing::TempDir() + "/prepared_job_" +
                 ::testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(directory_);
    std::filesystem::create_directories(directory_);
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }

  std::string Write(const std::string& name, const std::string& text) {
    std::ofstream(directory_ + "/" + name) << text;
    return directory_ + "/" + name;
  }
  // Writes a scene of a sphere whose environment comes from a file that all frames share.
  void WriteFrame(const std::string& name, const std::string& radius) {
    Write(
        name,
        "Film \"rgb\" \"integer xresolution\" [8] \"integer yresolution\" [4] \"string filename\" "
        "\"../elsewhere/image.png\"\nCamera \"perspective\"\nWorldBegin\n"
        "Include \"shared.pbrt\"\nShape \"sphere\" \"float radius\" [" +
            radius + "]\n");
  }
  std::optional<absl::Status> PrepareWhileSaved(const std::string& included);

  std::string directory_;
};

TEST_F(PreparedJobTest, SharesFilesBetweenFrames) {
  Write("shared.pbrt", "LightSource \"infinite\" \"rgb L\" [1 1 1]\n");
  WriteFrame("shot.01.pbrt", "1");
  WriteFrame("shot.02.pbrt", "2");
  JobArguments arguments;
  arguments.scene = directory_ + "/shot.##.pbrt";
  arguments.frames = "1-2";
  arguments.settings.samples = 3;
  const absl::StatusOr<PreparedJob> job = PrepareJob(arguments);
  ASSERT_TRUE(job.ok()) << job.status();
  ASSERT_EQ(job->frames.size(), 2u);
  EXPECT_EQ(job->frames[1].number, 2);
  EXPECT_EQ(job->frames[1].settings.samples, 3u);
  EXPECT_EQ(job->frames[1].settings.width_px, 8);
  EXPECT_EQ(job->blobs.size(), 5u);  // Two scenes, one shared file, two manifests.
  const v1::CreateJobRequest request = MakeCreateJobRequest(arguments, *job);
  EXPECT_EQ(request.frames_size(), 2);
  EXPECT_EQ(request.title(), "shot.##.pbrt");
  EXPECT_NE(request.request_id(), MakeCreateJobRequest(arguments, *job).request_id());
}

TEST_F(PreparedJobTest, ResumedImageIsUploaded) {
  Write("shared.pbrt", "LightSource \"infinite\" \"rgb L\" [1 1 1]\n");
  WriteFrame("one.pbrt", "1");
  JobArguments arguments;
  arguments.scene = directory_ + "/one.pbrt";
  arguments.resume_from = Write("before.exr", "an image");
  const absl::StatusOr<PreparedJob> job = PrepareJob(arguments);
  ASSERT_TRUE(job.ok()) << job.status();
  const v1::CreateJobRequest request = MakeCreateJobRequest(arguments, *job);
  const std::string digest = request.frames(0).resumed_image().sha256_hex();
  EXPECT_EQ(request.frames(0).resumed_image().size_bytes(), 8u);
  ASSERT_TRUE(job->blobs.contains(digest));
  EXPECT_EQ(job->blobs.at(digest).path, arguments.resume_from);
  arguments.scene = "shot.####.pbrt";
  arguments.frames = "1-2";
  EXPECT_THAT(std::string(CheckJobArguments(arguments).message()), HasSubstr("--resume-from"));
}

// A glass ball casts the light of a small lamp on the floor. Nothing is measured where it would
// cost more than a hundredth of the frame, where the samples are not known, and where a flag
// decides.
TEST_F(PreparedJobTest, LargeFramesChooseTheirTechniques) {
  JobArguments arguments;
  arguments.scene =
      Write("caustic.pbrt",
            "LookAt 0 1.5 -4 0 0.5 0 0 1 0\nCamera \"perspective\" \"float fov\" 40\n"
            "Film \"rgb\" \"integer xresolution\" [512] \"integer yresolution\" [512]\nWorldBegin\n"
            "Shape \"bilinearmesh\" \"point3 P\" [-4 0 -4 4 0 -4 -4 0 4 4 0 4]\n"
            "AttributeBegin\nTranslate 0 0.9 0\nMaterial \"dielectric\"\n"
            "Shape \"sphere\" \"float radius\" 0.6\nAttributeEnd\n"
            "AttributeBegin\nTranslate 0.5 2.6 -0.3\nAreaLightSource \"diffuse\" \"rgb L\" "
            "[900 900 900]\nShape \"sphere\" \"float radius\" 0.03\nAttributeEnd\n");
  arguments.settings.samples = 64;
  const auto techniques_of = [&]() -> std::string {
    const absl::StatusOr<PreparedJob> job = PrepareJob(arguments);
    if (!job.ok()) return job.status().ToString();
    const std::string name = job->frames.front().settings.techniques.Name();
    const std::string lines = absl::StrJoin(job->diagnostics, "\n");
    EXPECT_EQ(name != "camera", absl::StrContains(lines, "techniques: " + name)) << lines;
    EXPECT_EQ(name != "camera", absl::StrContains(lines, "; --techniques camera keeps")) << lines;
    return name;
  };
  EXPECT_THAT(techniques_of(), ::testing::AllOf(::testing::StartsWith("camera+light"),
                                                ::testing::Not(::testing::HasSubstr("merging"))));
  arguments.settings.samples = 63;
  EXPECT_EQ(techniques_of(), "camera");
  arguments.settings.samples = 64;
  arguments.settings.techniques = TechniqueSet::kCamera;
  EXPECT_EQ(techniques_of(), "camera");
  arguments.settings.techniques.reset();
  arguments.keep_camera_paths = true;
  EXPECT_EQ(techniques_of(), "camera");
  arguments.keep_camera_paths = false;
  arguments.stop.seconds = 60;
  EXPECT_EQ(techniques_of(), "camera");
  arguments.stop = {};
  arguments.resume_from = Write("before.exr", "an image");
  EXPECT_EQ(techniques_of(), "camera");
}

sem_t lease_breaks;  // Another opens the file of a lease.

// Replaces a file by another while the scene is read: a lease holds the reader at a later file
// until then.
// Prepares a scene whose main file is saved while the reader waits for its included file, which
// has the text. Absent: the file system cannot make a reader wait.
std::optional<absl::Status> PreparedJobTest::PrepareWhileSaved(const std::string& included) {
  const std::string scene =
      Write("one.pbrt",
            "Film \"rgb\" \"integer xresolution\" [8] \"integer yresolution\" [4]\n"
            "WorldBegin\nLightSource \"infinite\"\nInclude \"later.pbrt\"\n");
  const int later = ::open(Write("later.pbrt", included).c_str(), O_RDONLY | O_CLOEXEC);
  EXPECT_GE(later, 0);
  EXPECT_EQ(::sem_init(&lease_breaks, 0, 0), 0);
  std::signal(SIGIO, [](int) { ::sem_post(&lease_breaks); });
  if (::fcntl(later, F_SETLEASE, F_WRLCK) != 0) {
    ::close(later);
    return std::nullopt;
  }
  std::jthread saver([&] {
    while (::sem_wait(&lease_breaks) != 0) {
    }
    Write("saved",
          "Film \"rgb\" \"integer xresolution\" [16] \"integer yresolution\" [8]\n"
          "WorldBegin\nLightSource \"infinite\"\n");
    std::filesystem::rename(directory_ + "/saved", scene);
    ::close(later);  // Ends the lease.
  });
  JobArguments arguments;
  arguments.scene = scene;
  return PrepareJob(arguments).status();
}

TEST_F(PreparedJobTest, ASceneThatIsSavedWhileItIsReadIsNoMixture) {
  // In the second, the mixture is an error of its own, which is not the reason.
  for (const char* included : {"# Nothing.\n", "Shape \"teapot\"\n"}) {
    const std::optional<absl::Status> status = PrepareWhileSaved(included);
    if (!status) GTEST_SKIP() << "the file system of " << directory_ << " has no leases";
    EXPECT_TRUE(absl::IsFailedPrecondition(*status)) << *status;
    EXPECT_THAT(std::string(status->message()), HasSubstr("one.pbrt: changed while"));
  }
}

TEST_F(PreparedJobTest, SceneErrorsHaveALocation) {
  JobArguments arguments;
  arguments.scene = Write("bad.pbrt", "WorldBegin\nShape \"teapot\"\n");
  const absl::StatusOr<PreparedJob> job = PrepareJob(arguments);
  EXPECT_EQ(job.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(job.status().message()), HasSubstr("bad.pbrt:2:"));
  arguments.scene = directory_ + "/absent.pbrt";
  EXPECT_EQ(PrepareJob(arguments).status().code(), absl::StatusCode::kNotFound);
}

TEST_F(PreparedJobTest, RefusesConflictingArguments) {
  JobArguments arguments;
  arguments.scene = "shot.####.pbrt";
  EXPECT_THAT(std::string(CheckJobArguments(arguments).message()), HasSubstr("--frames"));
  arguments.frames = "1-24";
  EXPECT_TRUE(CheckJobArguments(arguments).ok());
  arguments.output = "out.exr";
  EXPECT_THAT(std::string(CheckJobArguments(arguments).message()), HasSubstr("####"));
  arguments.scene = "shot.pbrt";
  EXPECT_FALSE(CheckJobArguments(arguments).ok());
  arguments.frames.clear();
  EXPECT_TRUE(CheckJobArguments(arguments).ok());
  arguments.output = "out.####.exr";
  EXPECT_THAT(std::string(CheckJobArguments(arguments).message()), HasSubstr("--frames"));
}

TEST_F(PreparedJobTest, HashesAreLettersWhereNoFramesAreAskedFor) {
  const std::string scene = "WorldBegin\nLightSource \"infinite\"\n";
  std::filesystem::create_directories(directory_ + "/shot#7");
  std::filesystem::create_directories(directory_ + "/shot17");
  JobArguments arguments;
  for (const char* name : {"shot#7/take#2.pbrt", "shot#7/####.pbrt", "shot#7/s.pbrt"}) {
    arguments.scene = Write(name, scene);
    ASSERT_TRUE(CheckJobArguments(arguments).ok()) << name;
    EXPECT_EQ(ScenePath(arguments)->Of(1), arguments.scene);
  }
  Write("shot17/s.pbrt", scene);
  arguments.frames = "1-2";
  EXPECT_TRUE(absl::IsInvalidArgument(CheckJobArguments(arguments))) << "not shot17/s.pbrt";
  arguments.scene = directory_ + "/f/####/s.pbrt";
  EXPECT_EQ(ScenePath(arguments)->Of(2), directory_ + "/f/0002/s.pbrt");
  arguments.scene = directory_ + "/shot#7.glb";
  EXPECT_EQ(ScenePath(arguments)->Of(2), arguments.scene);
}

TEST_F(PreparedJobTest, ChoosesOutputPaths) {
  PreparedJob job;
  job.frames = {{1, {}, {}, "../elsewhere/image#1.png"}};
  JobArguments arguments;
  const auto path = [&](int32_t number, Numbering numbering) {
    return OutputPatterns(arguments, numbering, job)->Of(number);
  };
  constexpr Numbering kAsked = Numbering::kAsked, kUnasked = Numbering::kUnasked;
  arguments.scene = "scenes/room.pbrt";
  EXPECT_EQ(path(1, kUnasked).exr, "image#1.exr");  // Never outside this folder.
  EXPECT_EQ(path(1, kAsked).exr, "image#1.exr");
  job.frames[0].film_filename.clear();
  EXPECT_EQ(path(1, kUnasked).exr, "room.exr");
  EXPECT_EQ(path(1, kUnasked).png, "");
  arguments.output = "out/a#.png";
  EXPECT_EQ(path(1, kUnasked).exr, "out/a#.exr");
  EXPECT_EQ(path(1, kUnasked).png, "out/a#.png");
  EXPECT_EQ(path(1, Numbering::kUnknown).png, "out/a#.png");
  EXPECT_EQ(path(1, kAsked).png, "out/a1.png");
  EXPECT_EQ(path(1, kAsked).exr, "out/a1.exr");
  arguments.output = "a.##.exr";
  EXPECT_EQ(path(1, Numbering::kUnknown).exr, "a.01.exr");
  arguments.output.clear();
  arguments.scene = "shot.####.pbrt";
  job.frames = {{7, {}, {}, "same.exr"}, {8, {}, {}, "same.exr"}};
  EXPECT_EQ(path(8, kAsked).exr, "shot.0008.exr");
  arguments.scene = "f/####/s.pbrt";
  EXPECT_EQ(path(8, kAsked).exr, "s.0008.exr");
  arguments.scene = "shot#7.glb";
  EXPECT_EQ(path(8, kAsked).exr, "shot#7.0008.exr");
}

}  // namespace
}  // namespace sheaf::cli
