// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Ending a client's stream early. gRPC's in-process transport does not wake a client that is still
// writing when the answer arrives, so an early answer is sent only after the rest was read.
#pragma once

namespace sheaf::coordinator {

// Messages read after the answer is known; a sender that continues beyond them is cut off.
inline constexpr int kDrainMessagesMax = 4096;

// Reads and drops the rest of a stream.
template <typename Message, typename Reader>
void DrainStream(Message* message, Reader* reader) {
  for (int i = 0; i < kDrainMessagesMax && reader->Read(message); ++i) {
  }
}

}  // namespace sheaf::coordinator
