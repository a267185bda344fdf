// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/sandbox/message_channel.h"

#include <sys/socket.h>
#include <sys/uio.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
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

// Room for one descriptor beside the bytes.
struct FileMessage {
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
  msghdr header{};

  // buffers must outlive the object.
  FileMessage(iovec* buffers, size_t count) {
    header.msg_iov = buffers;
    header.msg_iovlen = count;
  }
  void Put(int file) {
    header.msg_control = control.data();
    header.msg_controllen = control.size();
    cmsghdr* const at = CMSG_FIRSTHDR(&header);
    at->cmsg_level = SOL_SOCKET;
    at->cmsg_type = SCM_RIGHTS;
    at->cmsg_len = CMSG_LEN(sizeof(int));
    std::memcpy(CMSG_DATA(at), &file, sizeof(int));
  }
};

// A confined process, which sends no files, may not make the call that would.
ssize_t WriteWithFile(int socket, iovec* buffers, size_t count, int file) {
  if (file < 0) return ::writev(socket, buffers, static_cast<int>(count));
  FileMessage message(buffers, count);
  message.Put(file);
  return ::sendmsg(socket, &message.header, 0);
}

// Reads what is there. A file that comes along goes to *file, which is closed first.
ssize_t ReceiveWithFile(int socket, char* bytes, size_t size_bytes, FileDescriptor* file) {
  iovec buffer{bytes, size_bytes};
  FileMessage message(&buffer, 1);
  message.header.msg_control = message.control.data();
  message.header.msg_controllen = message.control.size();
  const ssize_t got = ::recvmsg(socket, &message.header, MSG_CMSG_CLOEXEC);
  const cmsghdr* const at = got < 0 ? nullptr : CMSG_FIRSTHDR(&message.header);
  if (at != nullptr && at->cmsg_level == SOL_SOCKET && at->cmsg_type == SCM_RIGHTS &&
      at->cmsg_len == CMSG_LEN(sizeof(int))) {
    int descriptor = -1;
    std::memcpy(&descriptor, CMSG_DATA(at), sizeof(int));
    *file = FileDescriptor(descriptor);
  }
  return got;
}

}  // namespace

absl::Status MessageChannel::Send(std::string_view message, std::string_view payload, int file) {
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
    const ssize_t written = WriteWithFile(socket_.get(), buffers.data(), buffers.size(), file);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return StatusFromErrno(errno, "sending a message");
    file = -1;  // It goes with the first bytes.
    Advance(static_cast<size_t>(written), &buffers);
    left -= static_cast<size_t>(written);
  }
  return absl::OkStatus();
}

absl::StatusOr<MessageChannel::Received> MessageChannel::Receive() {
  Header header;
  Received received;
  absl::Status status = ReadAll(reinterpret_cast<char*>(&header), sizeof header,
                                limits_.takes_files ? &received.file : nullptr);
  if (!status.ok()) return status;
  if (header.message_bytes > limits_.message_bytes_max ||
      header.payload_bytes > limits_.payload_bytes_max) {
    return absl::InvalidArgumentError(absl::StrCat(
        "a message of ", header.message_bytes, " and ", header.payload_bytes,
        " bytes; the limits are ", limits_.message_bytes_max, " and ", limits_.payload_bytes_max));
  }
  received.message.resize(header.message_bytes);
  received.payload.resize(header.payload_bytes);
  status = ReadAll(received.message.data(), received.message.size());
  if (status.ok()) status = ReadAll(received.payload.data(), received.payload.size());
  if (!status.ok()) return status;
  return received;
}

absl::Status MessageChannel::ReadAll(char* bytes, size_t size_bytes, FileDescriptor* file) {
  while (size_bytes > 0) {
    const ssize_t got = file == nullptr ? ::read(socket_.get(), bytes, size_bytes)
                                        : ReceiveWithFile(socket_.get(), bytes, size_bytes, file);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0 && errno != ECONNRESET) return StatusFromErrno(errno, "receiving a message");
    if (got <= 0) return absl::OutOfRangeError("the other end has closed the stream");
    bytes += got;
    size_bytes -= static_cast<size_t>(got);
  }
  return absl::OkStatus();
}

}  // namespace sheaf::worker
