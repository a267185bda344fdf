// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary text to the parser of a frame's outputs, which arrive with jobs and in the
// headers of parts. Accepted lines are those that FormatOutputs writes.
#include "common/film/film_outputs.h"

#include <string>

#include "tests/fuzz/fuzz_target.h"

namespace sheaf {

SHEAF_FUZZ_TARGET(outputs) {
  const absl::StatusOr<FilmOutputs> outputs = ParseOutputs(bytes);
  if (outputs.ok()) {
    SHEAF_CHECK(FormatOutputs(*outputs) == bytes);
    SHEAF_CHECK(MeanChannelsOf(*outputs).size() == MeanChannelCount(*outputs));
  }
  FilmOutputs named;
  if (AddAovs(bytes, &named).ok() && AddCryptomattes(bytes, &named).ok()) {
    const absl::StatusOr<FilmOutputs> again = ParseOutputs(FormatOutputs(named));
    SHEAF_CHECK(again.ok() && *again == named);
  }
}

}  // namespace sheaf
