// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PreparedJob > the request that makes the job.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <random>

#include "absl/strings/str_format.h"
#include "cli/job/prepared_job.h"
#include "common/base/printable.h"
#include "common/rpc/settings_codec.h"

namespace sheaf::cli {

v1::StopRule StopRuleOf(const StopArguments& stop, int frame_count) {
  const auto set = [](double seconds, google::protobuf::Duration* duration) {
    const double whole = std::floor(seconds);
    duration->set_seconds(static_cast<int64_t>(whole));
    duration->set_nanos(static_cast<int32_t>((seconds - whole) * 1e9));
  };
  v1::StopRule rule;
  rule.set_target_error(stop.target_error);
  rule.set_certified(stop.certified);
  if (stop.seconds > 0) set(stop.seconds, rule.mutable_time_max());
  if (stop.budget_cpu_hours > 0) {
    set(3600 * stop.budget_cpu_hours / frame_count, rule.mutable_cpu_max());
  }
  return rule;
}

v1::CreateJobRequest MakeCreateJobRequest(const JobArguments& arguments, const PreparedJob& job) {
  v1::CreateJobRequest request;
  request.set_request_id(MakeRequestId());
  const std::string file_name = std::filesystem::path(arguments.scene).filename().string();
  request.set_title(arguments.title.empty() ? Printable(file_name) : arguments.title);
  request.set_priority(arguments.priority);
  request.set_show(arguments.show);
  v1::WorkerRequirements& requirements = *request.mutable_requirements();
  requirements.set_pool(arguments.pool);
  for (const std::string& tag : arguments.required_tags) requirements.add_tags(tag);
  requirements.set_memory_min_bytes(arguments.memory_min_bytes);
  for (const PreparedFrame& frame : job.frames) {
    requirements.set_memory_expected_bytes(
        std::max(requirements.memory_expected_bytes(), frame.memory_bytes));
  }
  request.mutable_partition()->set_tile_size_px(arguments.tile_size_px);
  request.mutable_partition()->set_cell_size_px(arguments.cell_size_px);
  request.mutable_partition()->set_pass_sample_count(arguments.pass_sample_count);
  request.mutable_partition()->set_lease_pass_count(arguments.lease_pass_count);
  for (const PreparedFrame& frame : job.frames) {
    v1::FrameSpec* spec = request.add_frames();
    spec->set_frame_number(frame.number);
    spec->mutable_scene()->set_sha256_hex(frame.manifest.sha256_hex);
    spec->mutable_scene()->set_size_bytes(frame.manifest.size_bytes);
    *spec->mutable_settings() = ToWire(frame.settings);
    if (!frame.resumed.sha256_hex.empty()) {
      spec->mutable_resumed_image()->set_sha256_hex(frame.resumed.sha256_hex);
      spec->mutable_resumed_image()->set_size_bytes(frame.resumed.size_bytes);
    }
    if (arguments.stop.IsActive())
      *spec->mutable_stop() = StopRuleOf(arguments.stop, static_cast<int>(job.frames.size()));
  }
  return request;
}

std::string MakeRequestId() {
  std::random_device random;
  const uint32_t a = random(), b = random(), c = random(), d = random();
  return absl::StrFormat("%08x-%04x-4%03x-%04x-%04x%08x", a, b >> 16, b & 0xfff,
                         0x8000 | (c & 0x3fff), c >> 16, d);
}

}  // namespace sheaf::cli
