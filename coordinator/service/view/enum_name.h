// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EnumName: the names of views' enumerated values, for people and programs.
#pragma once

#include <string>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "coordinator/service/view/farm_view.h"

namespace sheaf::coordinator {

inline const char* KnownName(JobState value) { return JobStateName(value); }
inline const char* KnownName(WorkerState value) { return WorkerStateName(value); }
inline const char* KnownName(StopReason value) { return StopReasonName(value); }
inline const char* KnownName(TaskKind value) { return TaskKindName(value); }
inline const char* KnownName(FailureKind value) { return FailureKindName(value); }
inline const char* KnownName(LeasePhase value) { return LeasePhaseName(value); }

// Whether this version has the value.
template <typename Enum>
bool IsKnown(Enum value) {
  return std::string_view(KnownName(value)) != "unknown";
}
// Its number for a value of a later version.
template <typename Enum>
std::string EnumName(Enum value) {
  return IsKnown(value) ? KnownName(value) : absl::StrCat(static_cast<int>(value));
}

}  // namespace sheaf::coordinator
