// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// WorkingHours: the hours of the week in which a worker may work, by the clock on the wall: after a
// change to summer time they begin when the clock says so.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/civil_time.h"

namespace sheaf::worker {

class WorkingHours {
 public:
  // All hours.
  WorkingHours() = default;
  // Parts, separated by commas, whose union counts; at most kPartsMax. A part is a range of times
  // ("19:00-07:00"), of days ("Sat-Sun"), or both ("Mon-Fri/20:00-06:30"). A range of times that
  // ends before it begins continues over midnight and belongs to the day on which it begins. 24:00
  // is the end of a day. Errors: kInvalidArgument, with the part.
  static absl::StatusOr<WorkingHours> Parse(const std::string& text);

  bool Contains(absl::CivilMinute time) const;

 private:
  static constexpr size_t kPartsMax = 64;
  struct Part {
    uint8_t days = 0x7f;  // Bit 0: Monday.
    int begin = 0;        // Minutes since the day's start.
    int end = 24 * 60;    // At most `begin`: on the next day.
  };
  static absl::StatusOr<Part> ParsePart(const std::string& text);

  std::vector<Part> parts_;
};

}  // namespace sheaf::worker
