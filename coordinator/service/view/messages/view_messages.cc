// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/view/messages/view_messages.h"

#include <map>

#include "common/scene/settings/techniques.h"
#include "coordinator/service/view/messages/view_reader.h"
#include "coordinator/service/view/messages/view_writer.h"

namespace sheaf::coordinator {
namespace {

// The numbers of the messages.
static_assert(static_cast<int>(JobState::kPaused) == v1::Job::STATE_PAUSED &&
              v1::Job::State_ARRAYSIZE == 7);
static_assert(static_cast<int>(WorkerState::kSick) == v1::Worker::STATE_SICK &&
              v1::Worker::State_ARRAYSIZE == 8);
static_assert(static_cast<int>(StopReason::kCpu) == v1::STOP_REASON_CPU &&
              v1::StopReason_ARRAYSIZE == kStopReasonCount);

template <typename Message, typename View>
Message Written(const View& view) {
  Message message;
  WriteView(view, &message);
  return message;
}

template <typename View>
View ReadFrom(const google::protobuf::Message& message) {
  View view;
  ReadView(message, &view);
  return view;
}

// Adds the trouble of a frame to the message of its job, if there is any.
void AddTrouble(const FrameView& frame, v1::Job* job) {
  if (frame.incomplete.empty() && frame.set_aside_count == 0) return;
  v1::FrameTrouble& trouble = *job->add_troubles();
  trouble.set_frame_number(frame.frame_number);
  trouble.set_incomplete(frame.incomplete);
  trouble.set_set_aside_task_count(frame.set_aside_count);
  for (const SetAsideView& task : frame.set_aside) {
    WriteView(task, trouble.add_set_aside_tasks());
  }
}

void ReadTrouble(const v1::FrameTrouble& trouble, FrameView* frame) {
  frame->incomplete = trouble.incomplete();
  frame->set_aside_count = trouble.set_aside_task_count();
  for (const v1::SetAsideTask& task : trouble.set_aside_tasks()) {
    ReadView(task, &frame->set_aside.emplace_back());
  }
}

}  // namespace

void SetDuration(absl::Duration duration, google::protobuf::Duration* wire) {
  const int64_t ns = absl::ToInt64Nanoseconds(duration);
  wire->set_seconds(ns / 1'000'000'000);
  wire->set_nanos(static_cast<int32_t>(ns % 1'000'000'000));
}

void SetTime(absl::Time time, google::protobuf::Timestamp* wire) {
  const absl::Duration since = time - absl::UnixEpoch();
  const int64_t seconds = absl::ToInt64Seconds(since);
  wire->set_seconds(seconds);
  wire->set_nanos(static_cast<int32_t>(absl::ToInt64Nanoseconds(since - absl::Seconds(seconds))));
}

v1::Job ToWire(const JobView& view) {
  v1::Job job = Written<v1::Job>(view);
  for (const EffectCost& effect : view.effect_costs) WriteView(effect, job.add_effect_costs());
  for (const FrameView& frame : view.frames) {
    v1::Frame& added = *job.add_frames();
    WriteView(frame, &added);
    added.set_name(FrameName(view.job_id, frame.frame_number));
    AddTrouble(frame, &job);
  }
  return job;
}

v1::Worker ToWire(const WorkerView& view) { return Written<v1::Worker>(view); }
v1::Share ToWire(const ShareView& view) { return Written<v1::Share>(view); }
v1::PriceRefinementResponse ToWire(const RefinementPrices& priced) {
  return Written<v1::PriceRefinementResponse>(priced);
}
v1::Removal ToWire(const RemovalView& removal) { return Written<v1::Removal>(removal); }
v1::JobEvent ToWire(const JobEvent& event) { return Written<v1::JobEvent>(event); }
v1::RecordedFailure ToWire(const TaskFailureView& failure) {
  return Written<v1::RecordedFailure>(failure);
}

JobView ViewOfMessage(const v1::Job& message) {
  auto view = ReadFrom<JobView>(message);
  for (const v1::EffectCost& effect : message.effect_costs()) {
    ReadView(effect, &view.effect_costs.emplace_back());
  }
  std::map<int32_t, const v1::FrameTrouble*> troubles;
  for (const v1::FrameTrouble& trouble : message.troubles()) {
    troubles[trouble.frame_number()] = &trouble;
  }
  for (const v1::Frame& frame : message.frames()) {
    FrameView& added = view.frames.emplace_back();
    ReadView(frame, &added);
    // The first reason is 0, as none is.
    added.stop_reason.reset();
    if (frame.complete()) added.stop_reason = static_cast<StopReason>(frame.stop_reason());
    added.has_unknown_techniques =
        !TechniqueSet::FromNumber(frame.spec().settings().techniques()).has_value();
    const auto trouble = troubles.find(added.frame_number);
    if (trouble != troubles.end()) ReadTrouble(*trouble->second, &added);
  }
  return view;
}

WorkerView ViewOfMessage(const v1::Worker& message) { return ReadFrom<WorkerView>(message); }
JobEvent ViewOfMessage(const v1::JobEvent& message) { return ReadFrom<JobEvent>(message); }
ShareView ViewOfMessage(const v1::Share& message) { return ReadFrom<ShareView>(message); }
RefinementPrices ViewOfMessage(const v1::PriceRefinementResponse& message) {
  return ReadFrom<RefinementPrices>(message);
}

}  // namespace sheaf::coordinator
