// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Luminaires as makers measure them: IES files of 1986 to 2019, type C. Source: ANSI/IESNA
// LM-63-02, "Standard File Format for the Electronic Transfer of Photometric Data".
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "common/scene/scene_description.h"

namespace sheaf {

// True for names that end in ".ies", in any case.
bool IsIesFileName(const std::string& name);

// The candelas of the file with all its multipliers, unfolded to the whole circle where it has a
// part only. What a tilted lamp gives (TILT=) is passed over: the table is of the lamp as measured.
// Memory is bounded by what the file holds, and by a limit of table entries.
// name: of the file, for errors, which are "name:line:column: what".
// Errors: kInvalidArgument for what is malformed or of another type, kResourceExhausted beyond the
// limits; those of opening and reading the file.
absl::StatusOr<CandelaTable> ReadIes(const std::string& name, const std::string& path);

}  // namespace sheaf
