// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/view/submission_desk.h"

namespace sheaf::coordinator {

const char* SubmissionStateName(SubmissionState state) {
  switch (state) {
    case SubmissionState::kReceiving:
      return "receiving";
    case SubmissionState::kReading:
      return "reading";
    case SubmissionState::kChoosing:
      return "choosing";
    case SubmissionState::kSubmitted:
      return "submitted";
    case SubmissionState::kRefused:
      return "refused";
  }
  return "unknown";
}

}  // namespace sheaf::coordinator
