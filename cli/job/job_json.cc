// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/job_json.h"

#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "coordinator/service/view/json/view_json.h"
#include "coordinator/service/view/messages/view_messages.h"

namespace sheaf::cli {
namespace {

using coordinator::JsonFields;
using coordinator::ViewOfMessage;

// The value of an enumeration without its prefix: "STATE_RUNNING" to "running". name: empty for a
// value of a later version, which stays a number.
std::string NameOfValue(absl::string_view name, absl::string_view prefix, int value) {
  if (!absl::ConsumePrefix(&name, prefix)) return absl::StrCat(value);
  return absl::StrReplaceAll(absl::AsciiStrToLower(name), {{"_", "-"}});
}

}  // namespace

std::string JobStateName(v1::Job::State state) {
  return NameOfValue(v1::Job::State_Name(state), "STATE_", state);
}

std::string WorkerStateName(v1::Worker::State state) {
  return NameOfValue(v1::Worker::State_Name(state), "STATE_", state);
}

std::string JobJson(const v1::Job& job) {
  const coordinator::JobView view = ViewOfMessage(job);
  std::vector<std::string> frames;
  for (const coordinator::FrameView& frame : view.frames) {
    frames.push_back(coordinator::FrameJson(view.job_id, frame, JsonFields::kMessages));
  }
  return coordinator::JobWithFramesJson(view, frames, JsonFields::kMessages);
}

std::string RefinementPricesJson(const v1::PriceRefinementResponse& response) {
  return coordinator::RefinementPricesJson(ViewOfMessage(response));
}

std::string WorkerJson(const v1::Worker& worker) {
  return coordinator::WorkerJson(ViewOfMessage(worker), JsonFields::kMessages);
}

std::string EventJson(const v1::JobEvent& event) {
  return coordinator::EventJson(ViewOfMessage(event));
}

std::string ShareJson(const v1::Share& share) {
  return coordinator::ShareJson(ViewOfMessage(share));
}

}  // namespace sheaf::cli
