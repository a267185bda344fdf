// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Scenes that attack: the process of a scene runs this program with a renderer that does what the
// name of its main file says.
#include "worker/sandbox/sandboxed_scenes.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/ptrace.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/base/check.h"
#include "common/base/file.h"
#include "common/base/log.h"
#include "common/base/mutex.h"
#include "common/volume/volume_file.h"
#include "tests/support/farm/acting_scenes.h"
#include "tests/support/temporary_path.h"
#include "tests/support/volume/volume_writers.h"
#include "worker/sandbox/scene_messages.h"
#include "worker/sandbox/scene_server.h"

namespace sheaf::worker {
namespace {

using ::testing::HasSubstr;

// The files of a scene that a worker fetches: names of one letter, which they hold.
absl::StatusOr<volume::FileBytes> FetchLetter(const std::string& name, const std::stop_token&) {
  if (name.size() != 1) return absl::NotFoundError("no letter");
  const std::string path = testing::TemporaryPath("letter-" + name);
  SHEAF_CHECK(WriteFileAtomically(path, name).ok());
  auto file = volume::FileBytes::Open(name, path);
  ::unlink(path.c_str());
  return file;
}

Protections Only(std::initializer_list<Protection> some) {
  Protections protections;
  for (const Protection protection : some) protections.Add(protection);
  return protections;
}

// With all protections that this system has, and without namespaces, as in many containers.
class SandboxedScenesTest : public ::testing::TestWithParam<Protections> {
 protected:
  void SetUp() override {
    ::setenv("SHEAF_SECRET", "1", 1);
    options_.mode = SandboxMode::kBest;
    options_.program.arguments = {"test", kSceneProcess};
    options_.protections = GetParam();
    options_.load_time_max = absl::Seconds(60);
    options_.task_time_max = absl::Seconds(60);
    inputs_.limits = {uint64_t{16} << 20, 0, 1, 2};
  }

  OpenResult Open(const std::string& main_file) {
    if (scenes_ == nullptr) scenes_ = *SandboxedScenes::Make(options_);
    inputs_.main_file = main_file;
    return scenes_->Open(inputs_, {});
  }
  absl::StatusOr<RenderedPart> Render(const std::string& what, std::stop_token stop = {}) {
    const OpenResult opened = Open("render " + what);
    if (opened.scene == nullptr) return opened.status;
    return opened.scene->Render({}, stop);
  }
  std::string SeenByScene(const std::string& what) {
    const absl::StatusOr<RenderedPart> part = Render(what);
    return part.ok() ? part->exr_bytes : std::string(part.status().message());
  }
  bool Has(Protection protection) {
    Open("render nothing");
    return scenes_->protections().Has(protection);
  }

  SandboxOptions options_;
  SceneInputs inputs_;
  std::unique_ptr<SandboxedScenes> scenes_;
};

INSTANTIATE_TEST_SUITE_P(
    Each, SandboxedScenesTest,
    ::testing::Values(Protections::All(), Only({Protection::kFileAccess, Protection::kSystemCalls}),
                      Only({Protection::kSystemCalls}), Protections()));

TEST_P(SandboxedScenesTest, RendersSeveralTasksAtOnce) {
  const OpenResult opened = Open("render image");
  ASSERT_NE(opened.scene, nullptr) << opened.status;
  EXPECT_EQ(opened.scene->memory_bytes(), 1'000u);
  std::atomic<int> rendered{0};
  std::vector<std::jthread> threads;
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([&] {
      const absl::StatusOr<RenderedPart> part = opened.scene->Render({}, {});
      rendered += part.ok() && part->exr_bytes == "rendered image" && part->ray_count == 5;
    });
  }
  threads.clear();
  EXPECT_EQ(rendered, 8);
}

TEST_P(SandboxedScenesTest, TakesAFieldAndTrainsOne) {
  const OpenResult opened = Open("render field");
  ASSERT_NE(opened.scene, nullptr) << opened.status;
  EXPECT_TRUE(absl::IsDataLoss(opened.scene->SetField("none", {})));
  EXPECT_EQ(opened.scene->SetField("broken", {}).code(), absl::StatusCode::kInternal);
  const std::string field(size_t{5} << 20, 'f');  // Larger than a part's message.
  ASSERT_TRUE(opened.scene->SetField(field, {}).ok());
  const absl::StatusOr<RenderedPart> part = opened.scene->Render({}, {});
  ASSERT_TRUE(part.ok()) << part.status();
  EXPECT_EQ(part->exr_bytes, field);
  const OpenResult another = Open("render image");
  Lease training;
  training.kind = TaskKind::kTraining;
  const absl::StatusOr<RenderedPart> trained = another.scene->Render(training, {});
  ASSERT_TRUE(trained.ok()) << trained.status();
  EXPECT_EQ(trained->exr_bytes, "a field");
}

TEST_P(SandboxedScenesTest, CostsAtMostTheTimeThatHasPassed) {
  const absl::StatusOr<RenderedPart> part = Render("image");
  ASSERT_TRUE(part.ok());
  EXPECT_LT(part->cpu_seconds, 60) << "the process claims 1e9 s";
}

TEST_P(SandboxedScenesTest, ReadsItsOwnFiles) {
  const std::string path = ::testing::TempDir() + "/file-of-a-scene.txt";
  std::ofstream(path) << "its text\n";
  inputs_.local_paths["a/name"] = path;
  const OpenResult opened = Open("read a/name");
  EXPECT_EQ(opened.failure_kind, FailureKind::kScene);
  EXPECT_EQ(opened.status.message(), "its text");
}

// A process that is confined reads .vdb files itself, as it cannot start another.
TEST_P(SandboxedScenesTest, ReadsVolumesWithOpenVdb) {
  const std::string path = testing::TemporaryPath("smoke.vdb");
  const std::string bytes =
      testing::VdbFile({{.value = [](const testing::Voxel&) { return 0.25f; }}}, {.blosc = true});
  ASSERT_TRUE(WriteFileAtomically(path, bytes).ok());
  inputs_.local_paths["smoke.vdb"] = path;
  EXPECT_EQ(Open("volume smoke.vdb").status.message(), "0.25");
  ASSERT_TRUE(WriteFileAtomically(path, bytes.substr(0, bytes.size() / 2)).ok());
  EXPECT_EQ(Open("volume smoke.vdb").status.message(),
            "smoke.vdb: the file is cut short or damaged");
  ::unlink(path.c_str());
}

TEST_P(SandboxedScenesTest, AsksForFilesThatTheWorkerFetches) {
  inputs_.open_on_demand = FetchLetter;
  EXPECT_EQ(Open("fetch abcdefgh").status.message(), "a b c d e f g h");
  EXPECT_EQ(Open("fetch a?").status.message(), "a no letter");
}

TEST_P(SandboxedScenesTest, MayNotAskForFilesThatItHasNot) {
  EXPECT_TRUE(absl::IsInternal(Open("fetch a").status));
}

TEST_P(SandboxedScenesTest, AFetchEndsWithTheLoad) {
  std::stop_source stop;
  inputs_.open_on_demand = [&stop](
                               const std::string&,
                               const std::stop_token& ended) -> absl::StatusOr<volume::FileBytes> {
    stop.request_stop();
    SleepUnlessStopped(absl::Minutes(10), ended);
    return absl::CancelledError("stopped");
  };
  Open("render nothing");
  inputs_.main_file = "fetch a";
  EXPECT_TRUE(absl::IsCancelled(scenes_->Open(inputs_, stop.get_token()).status));
}

TEST_P(SandboxedScenesTest, SeesNoOtherFile) {
  const std::string seen = SeenByScene("open /etc/passwd");
  if (Has(Protection::kNamespaces)) {
    EXPECT_EQ(seen, "ENOENT");
  } else if (Has(Protection::kFileAccess)) {
    EXPECT_EQ(seen, "EACCES");
  } else {
    GTEST_SKIP() << "needs namespaces or file access rules";
  }
}

TEST_P(SandboxedScenesTest, WritesNoFile) {
  Open("render nothing");
  if (scenes_->protections().empty()) GTEST_SKIP() << "needs a protection";
  EXPECT_NE(SeenByScene("write"), "opened");
}

TEST_P(SandboxedScenesTest, KnowsNoSecretsOfTheEnvironment) {
  EXPECT_EQ(SeenByScene("environment"), "none");
}

TEST_P(SandboxedScenesTest, ForbiddenCallsEndTheProcess) {
  if (!Has(Protection::kSystemCalls)) GTEST_SKIP() << "needs the filter";
  for (const char* what : {"socket", "fork", "exec", "trace"}) {
    const absl::Status status = Render(what).status();
    EXPECT_TRUE(absl::IsInternal(status)) << what << ": " << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr("SIGSYS")) << what;
  }
}

TEST_P(SandboxedScenesTest, ACrashWhileLoadingFailsTheLoad) {
  const OpenResult opened = Open("crash");
  EXPECT_EQ(opened.scene, nullptr);
  EXPECT_EQ(opened.failure_kind, FailureKind::kInternal);
  EXPECT_THAT(std::string(opened.status.message()), HasSubstr("loading the scene"));
  EXPECT_THAT(std::string(opened.status.message()), HasSubstr("SIGSEGV"));
}

TEST_P(SandboxedScenesTest, ACrashWhileRenderingFailsTheTask) {
  const absl::Status status = Render("crash").status();
  EXPECT_THAT(std::string(status.message()), HasSubstr("rendering"));
  EXPECT_THAT(std::string(status.message()), HasSubstr("SIGSEGV"));
  EXPECT_EQ(SeenByScene("image"), "rendered image") << "the next process renders";
}

TEST_P(SandboxedScenesTest, AFailedCheckIsQuoted) {
  const absl::Status status = Render("check").status();
  EXPECT_THAT(std::string(status.message()), HasSubstr("SIGABRT"));
  EXPECT_THAT(std::string(status.message()), HasSubstr("check failed: what.empty()"));
}

TEST_P(SandboxedScenesTest, AnExitIsAFailure) {
  EXPECT_THAT(std::string(Render("exit").status().message()), HasSubstr("code 7"));
}

TEST_P(SandboxedScenesTest, LackOfMemoryIsOne) {
  EXPECT_EQ(Open("memory").failure_kind, FailureKind::kMemory);
  EXPECT_TRUE(absl::IsResourceExhausted(Render("memory").status()));
}

TEST_P(SandboxedScenesTest, EndlessWorkIsStopped) {
  options_.load_time_max = options_.task_time_max = absl::Milliseconds(300);
  const OpenResult opened = Open("loop");
  EXPECT_EQ(opened.failure_kind, FailureKind::kInternal);
  EXPECT_THAT(std::string(opened.status.message()), HasSubstr("did not finish within 300ms"));
  EXPECT_THAT(std::string(Render("loop").status().message()), HasSubstr("did not finish"));
}

// Processes that are stopped heed no signal but one.
TEST_P(SandboxedScenesTest, ProcessesThatStandStillAreKilled) {
  OpenResult opened = Open("render wait");
  ASSERT_NE(opened.scene, nullptr);
  const std::vector<pid_t> processes = Descendants();
  ASSERT_FALSE(processes.empty());
  for (const pid_t process : processes) ASSERT_EQ(::kill(process, SIGSTOP), 0);
  opened.scene.reset();
  scenes_.reset();
  for (const pid_t process : processes) {
    while (::kill(process, 0) == 0) ::usleep(1'000);
  }
}

TEST_P(SandboxedScenesTest, ATaskCanBeCancelled) {
  for (const char* kind : {"render wait", "render loop"}) {  // The second one heeds nothing.
    std::stop_source stop;
    const OpenResult opened = Open(kind);
    ASSERT_NE(opened.scene, nullptr);
    std::jthread stopper([&] { stop.request_stop(); });
    EXPECT_TRUE(absl::IsCancelled(opened.scene->Render({}, stop.get_token()).status())) << kind;
  }
}

TEST_P(SandboxedScenesTest, ALoadCanBeCancelled) {
  std::stop_source stop;
  Open("render nothing");
  inputs_.main_file = "loop";
  std::jthread stopper([&] { stop.request_stop(); });
  EXPECT_TRUE(absl::IsCancelled(scenes_->Open(inputs_, stop.get_token()).status));
}

TEST_P(SandboxedScenesTest, OnlyTheWorkerCancels) {
  EXPECT_TRUE(absl::IsInternal(Render("pretend to be cancelled").status()));
}

TEST_P(SandboxedScenesTest, GarbageEndsTheProcess) {
  EXPECT_THAT(std::string(Render("garbage").status().message()), HasSubstr("it sent"));
}

TEST_P(SandboxedScenesTest, NoiseIsCut) {
  ::testing::internal::CaptureStderr();
  Render("noise").IgnoreError();
  const std::string log = ::testing::internal::GetCapturedStderr();
  EXPECT_THAT(log, HasSubstr("further ones are not shown"));
  size_t lines = 0;
  for (const char c : log) lines += c == '\n';
  EXPECT_LT(lines, static_cast<size_t>(kOutputLinesMax) + 10);
}

TEST_P(SandboxedScenesTest, EndsWithItsScene) {
  OpenResult opened = Open("render pid");
  ASSERT_NE(opened.scene, nullptr);
  const absl::StatusOr<RenderedPart> part = opened.scene->Render({}, {});
  ASSERT_TRUE(part.ok());
  if (Has(Protection::kNamespaces)) {
    EXPECT_EQ(part->exr_bytes, "1");
  }
  opened.scene.reset();
  EXPECT_EQ(::waitpid(-1, nullptr, WNOHANG), -1) << "a process is left";
  EXPECT_EQ(errno, ECHILD);
}

TEST(SandboxModeTest, RequiredMeansAllProtections) {
  SandboxOptions options;
  options.mode = SandboxMode::kBest;
  options.program.arguments = {"test", kSceneProcess};
  const Protections best = (*SandboxedScenes::Make(options))->protections();
  options.mode = SandboxMode::kRequired;
  const absl::Status status = SandboxedScenes::Make(options).status();
  EXPECT_EQ(status.ok(), best == Protections::All()) << status;
  if (!status.ok()) {
    EXPECT_THAT(std::string(status.message()), HasSubstr("--sandbox=best"));
  }
}

TEST(SandboxModeTest, AProgramThatIsMissingIsAnError) {
  SandboxOptions options;
  options.mode = SandboxMode::kBest;
  options.program.path = "/no/such/program";
  EXPECT_THAT(std::string(SandboxedScenes::Make(options).status().message()),
              HasSubstr("starting a process"));
}

TEST(SandboxModeTest, HasNames) {
  EXPECT_EQ(SandboxModeFromName("best"), SandboxMode::kBest);
  EXPECT_EQ(SandboxModeFromName("no"), std::nullopt);
  EXPECT_EQ(NamesOf(Protections::All()), "namespaces, file access rules, system call filter");
  EXPECT_EQ(NamesOf({}), "none");
}

}  // namespace

int RenderActingScene() {
  ActingScenes scenes;
  return RunSceneProcess(&scenes);
}

}  // namespace sheaf::worker

int main(int argc, char** argv) {
  if (argc == 2 && std::string(argv[1]) == sheaf::worker::kSceneProcess) {
    return sheaf::worker::RenderActingScene();
  }
  ::signal(SIGPIPE, SIG_IGN);
  testing::InitGoogleMock(&argc, argv);
  return RUN_ALL_TESTS();
}
