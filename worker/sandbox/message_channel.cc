// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/sandbox/message_channel.h"

#include <sys/uio.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <limits>

#include "absl/strings/str_cat.h"
#include "common/base/status.h"

namespace sheaf::worker {
namespace {

struct Header {
  uint32_t message_bytes = 0;
  uint32_t payload_bytes = 0;
};

iovec BufferOf(const void* bytes, size_t size_bytes) {
  return {const_cast<void*>(bytes), size_bytes};
}

// Removes what was written from the front of the buffers.
template <size_t N>
void Advance(size_t written, std::array<iovec, N>* buffers) {
  for (iovec& buffer : *buffers) {
    const size_t step = std::min(written, buffer.iov_len);
    buffer.iov_base = static_cast<char*>(buffer.iov_base) + step;
    buffer.iov_len -= step;
    written -= step;
  }
}

}  // namespace

absl::Status MessageChannel::Send(std::string_view message, std::string_view payload) {
  if (message.size() > std::numeric_limits<uint32_t>::max() ||
      payload.size() > std::numeric_limits<uint32_t>::max()) {
    return absl::InvalidArgumentError("a message of more than 4 GiB");
  }
  const Header header{static_cast<uint32_t>(message.size()), static_cast<uint32_t>(payload.size())};
  std::array<iovec, 3> buffers = {BufferOf(&header, sizeof header),
                                  BufferOf(message.data(), message.size()),
                                  BufferOf(payload.data(), payload.size())};
  size_t left = sizeof header + message.size() + payload.size();
  const MutexLock lock(&sending_);
  while (left > 0) {
    const ssize_t written = ::writev(socket_.get(), buffers.data(), buffers.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return StatusFromErrno(errno, "sending a message");
    Advance(static_cast<size_t>(written), &buffers);
    left -= static_cast<size_t>(written);
  }
  return absl::OkStatus();
}

absl::StatusOr<MessageChannel::Received> MessageChannel::Receive() {
  Header header;
  absl::Status status = ReadAll(reinterpret_cast<char*>(&header), sizeof header);
  if (!status.ok()) return status;
  if (header.message_bytes > limits_.message_bytes_max ||
      header.payload_bytes > limits_.payload_bytes_max) {
    return absl::InvalidArgumentError(absl::StrCat(
        "a message of ", header.message_bytes, " and ", header.payload_bytes,
        " bytes; the limits are ", limits_.message_bytes_max, " and ", limits_.payload_bytes_max));
  }
  Received received;
  received.message.resize(header.message_bytes);
  received.payload.resize(header.payload_bytes);
  status = ReadAll(received.message.data(), received.message.size());
  if (status.ok()) status = ReadAll(received.payload.data(), received.payload.size());
  if (!status.ok()) return status;
  return received;
}

absl::Status MessageChannel::ReadAll(char* bytes, size_t size_bytes) {
  while (size_bytes > 0) {
    const ssize_t got = ::read(socket_.get(), bytes, size_bytes);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0 && errno != ECONNRESET) return StatusFromErrno(errno, "receiving a message");
    if (got <= 0) return absl::OutOfRangeError("the other end has closed the stream");
    bytes += got;
    size_bytes -= static_cast<size_t>(got);
  }
  return absl::OkStatus();
}

}  // namespace sheaf::worker
