// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Deadlines of jobs: read from a command line, and judged by a quote.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "cli/quote/quote.h"

namespace sheaf::cli {

// Reads "18:00", the next such time in the zone, "2026-05-04 18:00" or "2026-05-04T18:00:00+02:00".
// Errors: kInvalidArgument (another form, or not after now).
absl::StatusOr<absl::Time> ParseDeadline(const std::string& text, absl::Time now,
                                         absl::TimeZone zone);

// The row of a quote for the job as submitted: the row of its error, or else of its number of
// samples; nullptr if there is none.
const QuoteRow* RowOfJob(const Quote& quote, double target_error);

// Says whether the farm in its present state meets the deadline, by the band of the row, and how
// many threads the job alone needs until then. One line, without its end.
std::string JudgeDeadline(absl::Time deadline, absl::Time now, absl::TimeZone zone,
                          const QuoteRow& row, int thread_count);

}  // namespace sheaf::cli
