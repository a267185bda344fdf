// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Views as messages and back, by the descriptions of their fields (view_field.h).
#pragma once

#include "absl/time/time.h"
#include "coordinator/service/view/farm_view.h"
#include "sheaf/v1/job.pb.h"

namespace sheaf::coordinator {

v1::Job ToWire(const JobView& view);
v1::Worker ToWire(const WorkerView& view);
v1::Share ToWire(const ShareView& view);
v1::PriceRefinementResponse ToWire(const RefinementPrices& priced);
v1::Removal ToWire(const RemovalView& removal);
v1::JobEvent ToWire(const JobEvent& event);
v1::RecordedFailure ToWire(const TaskFailureView& failure);

// The view of a message, without the fields that only HTTP shows. Nothing is checked: a value of a
// later version stays a number, and techniques of a later version become those of the camera.
JobView ViewOfMessage(const v1::Job& message);
WorkerView ViewOfMessage(const v1::Worker& message);
JobEvent ViewOfMessage(const v1::JobEvent& message);
ShareView ViewOfMessage(const v1::Share& message);
RefinementPrices ViewOfMessage(const v1::PriceRefinementResponse& message);

void SetDuration(absl::Duration duration, google::protobuf::Duration* wire);
void SetTime(absl::Time time, google::protobuf::Timestamp* wire);

}  // namespace sheaf::coordinator
