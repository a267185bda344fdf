// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/shown_job.h"

#include <cstdio>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "cli/duration.h"
#include "cli/error_text.h"
#include "cli/job/job_json.h"
#include "cli/job/summary.h"
#include "cli/progress_line.h"
#include "common/base/memory_room.h"
#include "common/base/printable.h"
#include "common/base/surroundings/local_time.h"

namespace sheaf::cli {
namespace {

constexpr int kWaitingShownMax = 16;

void PrintFrame(const v1::Frame& frame) {
  const v1::PixelRect& window = frame.spec().settings().window();
  const double error = frame.progress().relative_mse();
  std::printf(
      "%-8d %-12s %8llu %6.1f%%  %-11s %-7s %s\n", frame.spec().frame_number(),
      absl::StrCat(window.x1_px() - window.x0_px(), "x", window.y1_px() - window.y0_px()).c_str(),
      static_cast<unsigned long long>(frame.spec().settings().sample_count()),
      100 * FractionDone(frame.progress()), error > 0 ? FormatPixelError(error).c_str() : "- ",
      frame.flip() > 0 ? absl::StrFormat("%.4f", frame.flip()).c_str() : "-",
      frame.complete() ? frame.image_digest().substr(0, 16).c_str() : "-");
  const std::string eyes = FormatEyeErrors(frame);
  if (!eyes.empty()) std::printf("%8s %s\n", "", eyes.c_str());
}

// Prints the tasks of a frame that are set aside, why, and the command that gets a failed one.
void PrintTrouble(const std::string& job, const v1::FrameTrouble& trouble) {
  const int number = trouble.frame_number(), count = trouble.set_aside_task_count();
  const std::string command = absl::StrCat("sheaf bundle ", job, " --frame ", number);
  if (count == 0) {
    std::printf("frame %d is incomplete: %s\n  to reproduce: %s\n", number,
                PrintableLines(trouble.incomplete()).c_str(), command.c_str());
    return;
  }
  std::printf("frame %d %s: %d %s set aside\n", number,
              trouble.incomplete().empty() ? "continues" : "is incomplete", count,
              count == 1 ? "task is" : "tasks are");
  for (const v1::SetAsideTask& task : trouble.set_aside_tasks()) {
    std::printf("  task %u: %s\n", task.task(), PrintableLines(task.why()).c_str());
    if (task.failures().empty()) continue;
    std::printf("    to reproduce: %s --task %u\n", command.c_str(), task.task());
  }
}

// Prints some of the frames that wait for other jobs' frames or for approval.
void PrintWaiting(const v1::Job& job) {
  int count = 0;
  for (const v1::Frame& frame : job.frames()) {
    if (frame.waiting_reason().empty() || ++count > kWaitingShownMax) continue;
    std::printf("frame %d %s\n", frame.spec().frame_number(), frame.waiting_reason().c_str());
  }
  if (count > kWaitingShownMax) std::printf("and %d more frames wait\n", count - kWaitingShownMax);
}

// Prints which data of the job is kept.
std::string KeptText(const v1::Job& job) {
  if (job.has_parts_removed_time()) {
    const absl::Time time = absl::FromUnixSeconds(job.parts_removed_time().seconds());
    return absl::StrCat("parts removed on ", absl::FormatTime("%Y-%m-%d", time, LocalZone()),
                        ": sheaf refine continues from its image", job.pinned() ? "; pinned" : "");
  }
  return job.pinned() ? "pinned: all, until sheaf unpin" : "as the coordinator's limits say";
}

// Prints the job's deadline, and whether it will be met, by the band of its time left.
std::string DeadlineText(const v1::Job& job) {
  const absl::Time deadline = absl::FromUnixSeconds(job.deadline().time().seconds());
  std::string text = absl::FormatTime("%Y-%m-%d %H:%M", deadline, LocalZone());
  const v1::Progress& progress = job.progress();
  if (job.has_end_time() || !progress.has_remaining_duration_high()) return text;
  const double left = absl::ToDoubleSeconds(deadline - absl::Now());
  return absl::StrCat(text,
                      Seconds(progress.remaining_duration_high()) <= left  ? ", made"
                      : Seconds(progress.remaining_duration_low()) <= left ? ", at risk"
                                                                           : ", missed",
                      " by the forecast");
}

// Prints which workers the job may use.
std::string RequirementsText(const v1::WorkerRequirements& required) {
  std::string text = absl::StrCat("of the pool ", Printable(required.pool()));
  if (!required.tags().empty()) {
    absl::StrAppend(&text, ", with ", Printable(absl::StrJoin(required.tags(), ", ")));
  }
  if (required.memory_min_bytes() > 0) {
    absl::StrAppend(&text, ", with ", FormatMemory(required.memory_min_bytes()), " for scenes");
  }
  if (required.memory_expected_bytes() > 0) {
    absl::StrAppend(&text, "; its scenes need about ",
                    FormatMemory(required.memory_expected_bytes()));
  }
  return text;
}

}  // namespace

void PrintJob(const v1::Job& job) {
  std::printf("%s  %s\n", job.name().c_str(), Printable(job.title()).c_str());
  std::printf("state      %s\n", JobStateName(job.state()).c_str());
  if (!job.failure().empty()) {
    std::printf("failure    %s\n", PrintableLines(job.failure()).c_str());
  }
  if (!job.warning().empty()) {
    std::printf("warning    %s\n", PrintableLines(job.warning()).c_str());
  }
  for (const v1::JobDependency& dependency : job.dependencies()) {
    std::printf("after      %s%s: %s\n", dependency.job_name().c_str(),
                dependency.by_frame() ? ", frame by frame" : "", dependency.state().c_str());
  }
  if (const int count = job.unapproved_frame_count(); count > 0) {
    std::printf("approval   %d %s: sheaf approve %s\n", count,
                count == 1 ? "frame waits" : "frames wait", job.name().c_str());
  }
  if (job.has_deadline()) {
    std::printf("deadline   %s\n", DeadlineText(job).c_str());
  }
  if (!job.command().empty()) {
    std::printf("command    %s\n", PrintableLines(job.command()).c_str());
  }
  std::printf("progress   %s\n", FormatProgress(job).c_str());
  std::printf("rays       %s\n",
              FormatCount(static_cast<double>(job.progress().ray_count())).c_str());
  std::printf("priority   %d\n", job.priority());
  std::printf("show       %s\n", Printable(job.show()).c_str());
  std::printf("workers    %s\n", RequirementsText(job.requirements()).c_str());
  std::printf("profile    %s\n", job.numeric_profile().c_str());
  std::printf("kept       %s\n", KeptText(job).c_str());
  std::printf("\n%-8s %-12s %8s %7s  %-10s %-7s %s\n", "FRAME", "PIXELS", "SAMPLES", "DONE",
              "ERROR", "FLIP", "IMAGE");
  for (const v1::Frame& frame : job.frames()) PrintFrame(frame);
  for (const v1::FrameTrouble& trouble : job.troubles()) {
    PrintTrouble(job.name(), trouble);
  }
  PrintWaiting(job);
}

}  // namespace sheaf::cli
