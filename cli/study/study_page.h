// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The page of a study: one HTML with the study's JSON, its script and its style within, which loads
// nothing and so can be kept, sent and opened from a disk. Built from dashboard/src/study.
#pragma once

#include <string>
#include <string_view>

namespace sheaf::cli {

// The page that shows a study. Requires: `study_json` is valid JSON in UTF-8, in the format of
// dashboard/src/study/schema.ts. Thread-safe.
std::string StudyPage(std::string_view study_json);

// The page as it was built, with the mark "@study@" where the JSON belongs.
std::string_view StudyPageTemplate();

}  // namespace sheaf::cli
