// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The page of a study: one HTML file with the study's JSON, its script and its style. It loads
// nothing else, so it can be stored, sent and opened from a disk. Built from dashboard/src/study.
#pragma once

#include <string>
#include <string_view>

namespace sheaf::cli {

// The page that shows a study. Requires: `study_json` is valid JSON in UTF-8, in the format of
// dashboard/src/study/schema.ts. Thread-safe.
std::string StudyPage(std::string_view study_json);

// The page as built, with the mark "@study@" in place of the JSON.
std::string_view StudyPageTemplate();

}  // namespace sheaf::cli
