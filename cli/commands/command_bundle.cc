// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf bundle: writes a task of a job into one file, for sheaf repro.
#include <cstdint>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "cli/bundle/bundle_file.h"
#include "cli/commands/farm_command.h"
#include "cli/message.h"
#include "cli/progress_line.h"
#include "common/base/file.h"

namespace sheaf::cli {
namespace {

using Json = nlohmann::ordered_json;

class BundleCommand : public FarmCommand {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command =
        AddCommon(app, "bundle", "Write a failed task into a file that reproduces the failure");
    command
        ->add_option("JOB", target_,
                     "The job, as in jobs/7 or 7, or with a frame and a task of it, as in 7:12:3")
        ->required()
        ->check(IsText());
    CLI::Option* frame = command->add_option("--frame", frame_, "The frame");
    command->add_option("--task", task_, "The task of the frame, as sheaf show numbers them")
        ->needs(frame);
    command->add_option("-o,--output", output_, "The file (default: bundle-JOB-FRAME-TASK.tar)");
    command->footer(
        "Examples:\n"
        "  sheaf bundle jobs/7\n"
        "  sheaf bundle 7 --frame 12 --task 3 -o crash.tar\n"
        "  sheaf repro crash.tar\n"
        "Without a frame and a task, it is the first task that is set aside, otherwise another\n"
        "one that failed. A task that did not fail can be named, too. The file holds the scene's\n"
        "files: the owner of the job and operators may write it.");
    return command;
  }

  ExitCode Run() override {
    if (absl::Status status = ReadTarget(); !status.ok()) {
      return ReportError(ExitCode::kUsage, status);
    }
    if (absl::Status status = CheckWritable(output_); !status.ok()) {
      return ReportError(ExitCode::kFile, status);
    }
    return FarmCommand::Run();
  }

 protected:
  ExitCode RunWith(FarmClient* client) override {
    v1::ReadTaskBundleRequest request;
    request.set_name(JobName(job_));
    if (frame_) request.set_frame_number(*frame_);
    if (task_) request.set_task(*task_);
    BundleWriter writer(output_, SHEAF_VERSION);
    absl::Status written;
    const absl::Status read = client->ReadTaskBundle(
        request,
        [&](const v1::ReadTaskBundleResponse& message) { return written = writer.Take(message); });
    if (read.ok()) written = writer.Finish();
    if (!written.ok()) return ReportError(ExitCode::kFile, written);
    if (!read.ok()) return ReportCallError(read);
    Print(writer);
    return ExitCode::kOk;
  }

 private:
  // Splits JOB:FRAME:TASK, and names the file. Errors: kInvalidArgument.
  absl::Status ReadTarget() {
    const std::vector<std::string> words = absl::StrSplit(target_, ':');
    const bool names_part = words.size() > 1;
    int32_t frame = 0;
    uint32_t task = 0;
    if (words.size() > 3 || (names_part && (frame_ || !absl::SimpleAtoi(words[1], &frame))) ||
        (words.size() > 2 && !absl::SimpleAtoi(words[2], &task))) {
      return absl::InvalidArgumentError(absl::StrCat(
          "\"", target_, "\" is not of the form JOB, JOB:FRAME or JOB:FRAME:TASK, as in 7:12:3"));
    }
    job_ = words[0];
    if (names_part) frame_ = frame;
    if (words.size() > 2) task_ = task;
    if (!output_.empty()) return absl::OkStatus();
    const std::vector<std::string> name = absl::StrSplit(job_, '/');
    output_ = absl::StrCat("bundle-", name.back(), frame_ ? absl::StrCat("-", *frame_) : "",
                           task_ ? absl::StrCat("-", *task_) : "", ".tar");
    return absl::OkStatus();
  }

  void Print(const BundleWriter& writer) const {
    const v1::TaskBundle& task = writer.task();
    if (json()) {
      const Json object = {{"path", output_},
                           {"frame", task.frame_name()},
                           {"task", task.whole_frame() ? Json() : Json(task.task())},
                           {"failure_count", task.failures_size()},
                           {"size_bytes", writer.size_bytes()}};
      std::printf("%s\n", object.dump().c_str());
      return;
    }
    std::printf("%s: %s%s, %s, %s bytes; sheaf repro %s renders it\n", output_.c_str(),
                task.frame_name().c_str(),
                task.whole_frame() ? "" : absl::StrCat(", task ", task.task()).c_str(),
                task.failures_size() == 0
                    ? "no failure recorded"
                    : absl::StrCat(task.failures(0).kind(), " failure").c_str(),
                FormatCount(static_cast<double>(writer.size_bytes())).c_str(), output_.c_str());
  }

  std::string target_, job_, output_;
  std::optional<int32_t> frame_;
  std::optional<uint32_t> task_;
};

}  // namespace

std::unique_ptr<Command> MakeBundleCommand() { return std::make_unique<BundleCommand>(); }

}  // namespace sheaf::cli
