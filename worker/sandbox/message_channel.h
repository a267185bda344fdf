// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MessageChannel: one end of a local stream socket that carries messages, each followed by bytes.
//
//     uint32 size of the message | uint32 number of bytes | message | bytes
//
// Both ends are processes of one machine, so the sizes are in its byte order. An open file may go
// with a message (SCM_RIGHTS), to an end that takes such.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/base/mutex.h"
#include "common/content/file_descriptor.h"

namespace sheaf::worker {

// Limits of what an end accepts.
struct MessageLimits {
  uint32_t message_bytes_max = 0;
  uint32_t payload_bytes_max = 0;
  bool takes_files = false;  // Otherwise open files that come are closed.
};

// Thread safety: any number of threads may send, while one receives.
class MessageChannel {
 public:
  struct Received {
    std::string message;
    std::string payload;
    FileDescriptor file;  // One that came with the message.
  };

  // Requires: SIGPIPE is ignored.
  MessageChannel(FileDescriptor socket, MessageLimits limits)
      : socket_(std::move(socket)), limits_(limits) {}

  // Errors: kUnavailable if the other end is closed or accepts no bytes (within the socket's
  // timeout, if it has one): the stream is then unusable. kInvalidArgument if the sizes exceed what
  // the format can express.
  // file: an open file to send along, or -1.
  absl::Status Send(std::string_view message, std::string_view payload = {}, int file = -1);

  // Waits for a message. Errors: kOutOfRange if the other end has closed the stream;
  // kInvalidArgument if it sent more than the limits allow; kUnavailable for errors of the socket.
  absl::StatusOr<Received> Receive();

  // For poll(2).
  int descriptor() const { return socket_.get(); }

 private:
  // Reads all bytes. *file, unless null, takes a file that comes with them.
  absl::Status ReadAll(char* bytes, size_t size_bytes, FileDescriptor* file = nullptr);

  const FileDescriptor socket_;
  const MessageLimits limits_;
  Mutex sending_;  // Held while one message is written.
};

}  // namespace sheaf::worker
