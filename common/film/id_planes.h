// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Encodes lists of ids (id_sums.h) as planes of a part: entry k of all lists takes three planes, id
// + 1 (0 if the list is shorter) and the weight as a double-float. Names are a text.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "common/film/film_outputs.h"
#include "common/film/id_sums.h"

namespace sheaf {

// "ids.object.000.id", "ids.object.000.W", "ids.object.000.lo", "ids.object.001.id" ...
std::string IdPlaneName(IdKind kind, size_t plane);
bool IsIdPlaneName(IdKind kind, std::string_view name);

// As many planes as the longest list needs, each over all pixels.
std::vector<std::vector<float>> IdPlanes(const IdSums& ids);
// "NUMBER NAME" per line, with C escapes.
std::string NamesText(const std::map<uint32_t, std::string>& names);

// Decodes untrusted planes and text.
// Requires: ids->pixels has one empty list per pixel of a plane.
// Errors: kInvalidArgument if IdPlanes and NamesText cannot have written them.
absl::Status ReadIds(const std::string& names_text, const std::vector<std::vector<float>>& planes,
                     IdSums* ids);

}  // namespace sheaf
