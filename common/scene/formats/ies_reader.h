// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Luminaires as measured by their makers: IES files of 1986 to 2019, type C. Source: ANSI/IESNA
// LM-63-02, "Standard File Format for the Electronic Transfer of Photometric Data".
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "common/scene/scene_description.h"

namespace sheaf {

// True for names that end in ".ies", ignoring case.
bool IsIesFileName(const std::string& name);

// The candelas of the file with all its multipliers applied, unfolded to the full circle if the
// file has only a part of it. The output of a tilted luminaire (TILT=) is ignored: the table is
// that of the luminaire as measured. Memory is bounded by the size of the file and by a limit on
// table entries. name: of the file, for errors, which read "name:line:column: what".
// Errors: kInvalidArgument for malformed files and other types, kResourceExhausted beyond the
// limits; errors of opening and reading the file.
absl::StatusOr<CandelaTable> ReadIes(const std::string& name, const std::string& path);

}  // namespace sheaf
