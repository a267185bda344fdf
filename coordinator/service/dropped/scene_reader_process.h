// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ReadDroppedScene: a process that reads the scene of a submission, alone with its files. The
// program confines itself before it reads them (cli/dropped); here it is limited from outside, and
// nothing that it says is believed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <stop_token>
#include <string>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "sheaf/v1/submission.pb.h"

namespace sheaf::coordinator {

struct ReaderProcessLimits {
  absl::Duration wall_max = absl::Minutes(10);
  absl::Duration cpu_max = absl::Minutes(20);  // All its threads.
  uint64_t memory_bytes_max = uint64_t{8} << 30;
  // Limits of what it writes: files out of a zip file, and images out of a glTF file.
  uint64_t written_bytes_max = uint64_t{4} << 30;
  uint32_t written_files_max = 20'000;
  size_t reply_bytes_max = size_t{64} << 20;  // As for calls of gRPC.
};
// How often the limit of written files is checked. A process may exceed it for this long.
inline constexpr absl::Duration kWrittenInterval = absl::Milliseconds(200);

// Starts `program --dropped-scene` with the request, to which the limits and the folder are added,
// and waits for its end. The process gets no descriptor but its standard ones, and of the
// environment only what libraries need to load. Errors: kInvalidArgument (it ended without an
// answer, which the scene has caused); kDeadlineExceeded, kResourceExhausted (a limit); kCancelled;
// kUnavailable (it cannot be started). The reply may be an error too.
absl::StatusOr<v1::PrepareReply> ReadDroppedScene(const std::string& program,
                                                  const std::string& folder,
                                                  v1::PrepareRequest request,
                                                  const ReaderProcessLimits& limits,
                                                  const std::stop_token& stop);

}  // namespace sheaf::coordinator
