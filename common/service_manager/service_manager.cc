// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/service_manager/service_manager.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "common/base/log.h"

namespace sheaf {
namespace {

std::string TakeVariable(const char* name) {
  const char* value = std::getenv(name);
  const std::string taken = value == nullptr ? "" : value;
  ::unsetenv(name);
  return taken;
}

// A socket that sends to the address: a path, or a name of the abstract namespace, written with a
// leading '@'. -1 if there is none.
int ConnectTo(const std::string& name) {
  sockaddr_un address{};
  const bool known = name[0] == '/' || name[0] == '@';
  if (!known || name.size() < 2 || name.size() >= sizeof address.sun_path) return -1;
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path, name.data(), name.size());
  if (name[0] == '@') address.sun_path[0] = '\0';
  // A path ends with a zero, which counts; an abstract name is all of its bytes.
  const size_t length =
      offsetof(sockaddr_un, sun_path) + name.size() + (name[0] == '/' ? size_t{1} : size_t{0});
  const int socket = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (socket < 0) return -1;
  if (::connect(socket, reinterpret_cast<const sockaddr*>(&address),
                static_cast<socklen_t>(length)) == 0) {
    return socket;
  }
  ::close(socket);
  return -1;
}

}  // namespace

ServiceManager::ServiceManager() {
  const std::string name = TakeVariable("NOTIFY_SOCKET");
  const std::string timeout = TakeVariable("WATCHDOG_USEC");
  const std::string watched = TakeVariable("WATCHDOG_PID");
  if (name.empty()) return;
  socket_ = ConnectTo(name);
  if (socket_ < 0) {
    LogWarning(absl::StrCat("NOTIFY_SOCKET names no socket (", name,
                            "): the service manager will not hear that this program has started"));
    return;
  }
  int64_t microseconds = 0;
  const bool is_watched = watched.empty() || watched == absl::StrCat(::getpid());
  if (is_watched && absl::SimpleAtoi(timeout, &microseconds) && microseconds > 0) {
    watchdog_timeout_ = absl::Microseconds(microseconds);
  }
}

ServiceManager::~ServiceManager() {
  if (socket_ >= 0) ::close(socket_);
}

void ServiceManager::Ready(const std::string& status) const {
  Send(absl::StrCat("READY=1\nSTATUS=", absl::StrReplaceAll(status, {{"\n", " "}})));
}

void ServiceManager::Status(const std::string& status) const {
  Send(absl::StrCat("STATUS=", absl::StrReplaceAll(status, {{"\n", " "}})));
}

void ServiceManager::Stopping() const { Send("STOPPING=1\nSTATUS=stopping"); }

void ServiceManager::KeepAlive() const { Send("WATCHDOG=1"); }

void ServiceManager::Send(const std::string& lines) const {
  if (socket_ < 0) return;
  (void)!::send(socket_, lines.data(), lines.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
}

}  // namespace sheaf
