// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The program that reads scenes is a shell script here, which answers as the test says, or
// misbehaves.
#include "coordinator/service/dropped/submissions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/file.h"
#include "tests/support/temporary_path.h"

namespace sheaf::coordinator {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

const SubmissionCaller kAnna{"anna", "user:anna at 192.0.2.7"};
const SubmissionCaller kBen{"ben", "user:ben at 192.0.2.8"};

class SubmissionsTest : public ::testing::Test {
 protected:
  SubmissionsTest() {
    std::filesystem::create_directories(folder_);
    options_.folder = folder_ + "/dropped";
    options_.program = folder_ + "/reader";
    options_.write_with_space = [](uint64_t, const auto& write) { return write(); };
    options_.reader.wall_max = absl::Seconds(20);
  }
  ~SubmissionsTest() override {
    desk_.reset();
    std::filesystem::remove_all(folder_);
  }
  // The process runs the lines after it has read its request.
  void Script(const std::string& lines) {
    const std::string text =
        absl::StrCat("#!/bin/sh\ncat > '", folder_, "/request'\n", lines, "\n");
    ASSERT_TRUE(WriteFileOnce(options_.program, text).ok());
    ASSERT_EQ(::chmod(options_.program.c_str(), 0700), 0);
  }
  void Reply(const v1::PrepareReply& reply) {
    ASSERT_TRUE(WriteFileOnce(folder_ + "/reply", reply.SerializeAsString()).ok());
    Script(absl::StrCat("exec cat '", folder_, "/reply'"));
  }
  void Start() {
    auto desk = Submissions::Start(
        options_,
        [this](const SubmissionCaller& caller, const std::string& folder,
               const v1::PrepareReply& reply) -> absl::StatusOr<std::string> {
          made_ = absl::StrCat(caller.owner, ": ", reply.job().title(), ", ",
                               ReadWholeFile(folder + "/files/scene.pbrt").value_or("nothing"));
          if (reply.job().title() == "too much") return absl::ResourceExhaustedError("a limit");
          return std::string("7");
        });
    ASSERT_TRUE(desk.ok()) << desk.status();
    desk_ = *std::move(desk);
  }
  // A submission with a scene.
  std::string Begin(const SubmissionCaller& caller = kAnna) {
    const absl::StatusOr<SubmissionView> view = desk_->Begin(caller);
    EXPECT_TRUE(view.ok()) << view.status();
    if (!view.ok()) return "";
    EXPECT_TRUE(desk_->Append(caller, view->id, "scene.pbrt", 0, "text").ok());
    return view->id;
  }
  SubmissionView Read(const std::string& id, const SubmissionWish& wish = {}) {
    EXPECT_TRUE(desk_->Read(kAnna, id, wish).ok());
    SubmissionView view;
    do {
      absl::SleepFor(absl::Milliseconds(2));
      view = desk_->Find(kAnna, id).value_or(SubmissionView());
    } while (view.state == SubmissionState::kReading);
    return view;
  }
  v1::PrepareRequest Request() {
    v1::PrepareRequest request;
    EXPECT_TRUE(request.ParseFromString(ReadWholeFile(folder_ + "/request").value_or("")));
    return request;
  }

  const std::string folder_ = sheaf::testing::TemporaryPath("submissions");
  SubmissionOptions options_;
  std::string made_;  // The input of the last job.
  std::unique_ptr<Submissions> desk_;
};

TEST_F(SubmissionsTest, ASceneBecomesAJobOfItsOwner) {
  v1::PrepareReply reply;
  reply.mutable_job()->set_title("room");
  reply.add_notes("scene.pbrt:1:1: note: \x1b[31mred");
  Reply(reply);
  Start();
  const std::string id = Begin();
  const SubmissionView view = Read(id, {"", "room", 16, 0.5});
  EXPECT_EQ(view.state, SubmissionState::kSubmitted);
  EXPECT_EQ(view.job_id, "7");
  EXPECT_THAT(view.messages, HasSubstr("\\x1b[31mred"));
  EXPECT_EQ(made_, "anna: room, text");
  const v1::PrepareRequest request = Request();
  EXPECT_EQ(request.title(), "room");
  EXPECT_EQ(request.samples(), 16u);
  EXPECT_EQ(request.target_error(), 0.5);
  EXPECT_EQ(request.protections(), 7u);
  EXPECT_EQ(request.memory_bytes_max(), options_.reader.memory_bytes_max);
  EXPECT_FALSE(std::filesystem::exists(request.folder())) << "the files are removed";
}

TEST_F(SubmissionsTest, WhatIsWrongWithASceneIsSaid) {
  v1::PrepareReply reply;
  reply.set_code(static_cast<int>(absl::StatusCode::kInvalidArgument));
  reply.set_message("scene.pbrt:3:5: unknown directive \"Shap\"");
  Reply(reply);
  Start();
  const SubmissionView view = Read(Begin());
  EXPECT_EQ(view.state, SubmissionState::kRefused);
  EXPECT_EQ(view.messages, reply.message());
  EXPECT_EQ(made_, "") << "no job";
  EXPECT_TRUE(std::filesystem::is_empty(options_.folder));
}

TEST_F(SubmissionsTest, ALimitOfTheOwnerIsSaid) {
  v1::PrepareReply reply;
  reply.mutable_job()->set_title("too much");
  Reply(reply);
  Start();
  const SubmissionView view = Read(Begin());
  EXPECT_EQ(view.state, SubmissionState::kRefused);
  EXPECT_EQ(view.messages, "a limit");
}

TEST_F(SubmissionsTest, OneOfSeveralScenesIsChosen) {
  v1::PrepareReply reply;
  reply.add_scenes("a.pbrt");
  reply.add_scenes("b.pbrt");
  Reply(reply);
  Start();
  const std::string id = Begin();
  SubmissionView view = Read(id);
  EXPECT_EQ(view.state, SubmissionState::kChoosing);
  EXPECT_THAT(view.scenes, ElementsAre("a.pbrt", "b.pbrt"));
  reply.clear_scenes();
  reply.mutable_job()->set_title("b");
  Reply(reply);
  view = Read(id, {"b.pbrt", "", 0, 0});
  EXPECT_EQ(view.state, SubmissionState::kSubmitted);
  EXPECT_EQ(Request().scene(), "b.pbrt");
}

TEST_F(SubmissionsTest, AProcessThatEndsWithoutAnAnswerIsTheScenesFault) {
  Script("kill -SEGV $$");
  Start();
  EXPECT_THAT(Read(Begin()).messages, HasSubstr("ended by signal 11"));
  Script("exit 134");  // As a process in namespaces says of signal 6.
  EXPECT_THAT(Read(Begin()).messages, HasSubstr("ended by signal 6"));
  Script("echo garbage");
  EXPECT_THAT(Read(Begin()).messages, HasSubstr("ended with code 0"));
}

TEST_F(SubmissionsTest, AProcessThatHangsIsEnded) {
  options_.reader.wall_max = absl::Milliseconds(300);
  Script("sleep 600 & sleep 600");
  Start();
  EXPECT_THAT(Read(Begin()).messages, HasSubstr("takes longer than 300ms"));
}

TEST_F(SubmissionsTest, AProcessThatWritesOrSaysTooMuchIsEnded) {
  options_.reader.written_bytes_max = 10'000;
  options_.reader.reply_bytes_max = 10'000;
  Start();
  const std::string id = Begin();
  Script(absl::StrCat("head -c 20000 /dev/zero > '", options_.folder, "/", id,
                      "/scratch/f'; sleep 600"));
  EXPECT_THAT(Read(id).messages, HasSubstr("larger than"));
  Script("head -c 20000 /dev/zero; sleep 600");
  EXPECT_THAT(Read(Begin()).messages, HasSubstr("too many frames or messages"));
}

TEST_F(SubmissionsTest, WithoutConfinementNothingIsRead) {
  v1::PrepareReply reply;
  reply.set_code(static_cast<int>(absl::StatusCode::kUnavailable));
  reply.set_message("filtering system calls: not here");
  reply.set_missing_protection(4);
  Reply(reply);
  Start();
  EXPECT_THAT(Read(Begin()).messages, HasSubstr("cannot confine a process"));
  // A process cannot get by with less than the system has.
  reply.set_missing_protection(1);
  Reply(reply);
  EXPECT_THAT(Read(Begin()).messages, HasSubstr("filtering system calls"));
  EXPECT_EQ(Request().protections(), 6u);
}

TEST_F(SubmissionsTest, SubmissionsAreTheirOwners) {
  Start();
  const std::string id = Begin();
  EXPECT_TRUE(absl::IsNotFound(desk_->Find(kBen, id).status()));
  EXPECT_TRUE(absl::IsNotFound(desk_->Append(kBen, id, "a", 0, "x").status()));
  EXPECT_TRUE(absl::IsNotFound(desk_->Read(kBen, id, {}).status()));
  EXPECT_TRUE(absl::IsNotFound(desk_->Discard(kBen, id)));
  EXPECT_TRUE(absl::IsNotFound(desk_->Find(kAnna, "99").status()));
  EXPECT_TRUE(absl::IsNotFound(desk_->Find(kAnna, "x").status()));
  EXPECT_TRUE(desk_->Discard(kAnna, id).ok());
  EXPECT_TRUE(absl::IsNotFound(desk_->Find(kAnna, id).status()));
  EXPECT_TRUE(std::filesystem::is_empty(options_.folder));
}

TEST_F(SubmissionsTest, EachHasItsTime) {
  v1::PrepareReply reply;
  reply.mutable_job()->set_title("room");
  Reply(reply);
  Start();
  const absl::StatusOr<SubmissionView> empty = desk_->Begin(kAnna);
  EXPECT_TRUE(absl::IsInvalidArgument(desk_->Read(kAnna, empty->id, {}).status())) << "no file";
  const std::string id = Begin();
  Read(id);
  EXPECT_TRUE(absl::IsFailedPrecondition(desk_->Read(kAnna, id, {}).status()));
  EXPECT_TRUE(absl::IsFailedPrecondition(desk_->Append(kAnna, id, "a", 0, "x").status()));
  EXPECT_TRUE(absl::IsInvalidArgument(
      desk_->Append(kAnna, empty->id, "a", 0, std::string(kPieceBytesMax + 1, 'x')).status()));
}

TEST_F(SubmissionsTest, NumbersOfSubmissionsAreLimited) {
  v1::PrepareReply reply;
  reply.mutable_job()->set_title("room");
  Reply(reply);
  Start();
  std::string first;
  for (size_t i = 0; i < kSubmissionsOfOwnerMax; ++i) {
    const std::string id = Begin();
    if (i == 0) first = id;
  }
  EXPECT_TRUE(absl::IsResourceExhausted(desk_->Begin(kAnna).status()));
  EXPECT_TRUE(desk_->Begin(kBen).ok());
  Read(first);
  EXPECT_TRUE(desk_->Begin(kAnna).ok()) << "in the place of the one that has ended";
  EXPECT_TRUE(absl::IsNotFound(desk_->Find(kAnna, first).status()));
}

TEST_F(SubmissionsTest, LeftOversAreRemovedAtTheStart) {
  std::filesystem::create_directories(options_.folder + "/3/files");
  Start();
  EXPECT_TRUE(std::filesystem::is_empty(options_.folder));
  options_.why_not = "not here";
  desk_.reset();
  Start();
  EXPECT_EQ(desk_->Offer().why_not, "not here");
  EXPECT_TRUE(absl::IsFailedPrecondition(desk_->Begin(kAnna).status()));
}

}  // namespace
}  // namespace sheaf::coordinator
