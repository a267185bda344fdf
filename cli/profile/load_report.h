// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LoadTimes as text and as JSON.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "common/base/load_phases.h"

namespace sheaf::cli {

// A table of the phases that the process has been in, their rest and their sum, and when the first
// sample began; each line ends.
std::string FormatLoadTimes(const LoadTimes& times);
// The same with unrounded seconds.
nlohmann::ordered_json LoadTimesJson(const LoadTimes& times);

}  // namespace sheaf::cli
