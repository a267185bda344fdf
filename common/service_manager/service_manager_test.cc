// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/service_manager/service_manager.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/service_manager/watchdog.h"

namespace sheaf {
namespace {

constexpr int kPatienceMs = 20'000;  // For a slow machine.

// The manager's end of the socket.
class Listener {
 public:
  explicit Listener(const std::string& name) : socket_(::socket(AF_UNIX, SOCK_DGRAM, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path, name.data(), name.size());
    if (name[0] == '@') address.sun_path[0] = '\0';
    const size_t length = offsetof(sockaddr_un, sun_path) + name.size() + (name[0] == '/' ? 1 : 0);
    EXPECT_EQ(::bind(socket_, reinterpret_cast<const sockaddr*>(&address),
                     static_cast<socklen_t>(length)),
              0);
  }
  ~Listener() { ::close(socket_); }

  // The next datagram; none if there is none within the time.
  std::optional<std::string> Next(int wait_ms = kPatienceMs) const {
    pollfd waiting{socket_, POLLIN, 0};
    if (::poll(&waiting, 1, wait_ms) != 1) return std::nullopt;
    char text[512];
    const ssize_t size = ::recv(socket_, text, sizeof text, 0);
    return size < 0 ? std::nullopt : std::optional(std::string(text, static_cast<size_t>(size)));
  }

 private:
  int socket_;
};

class ServiceManagerTest : public ::testing::Test {
 protected:
  ~ServiceManagerTest() override {
    for (const char* name : {"NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"}) ::unsetenv(name);
  }
  static void Set(const char* name, const std::string& value) {
    ::setenv(name, value.c_str(), /*replace=*/1);
  }
  // Listening there again removes what an earlier test left.
  static std::string Path() {
    std::string path = ::testing::TempDir() + "notify";
    ::unlink(path.c_str());
    return path;
  }
};

TEST_F(ServiceManagerTest, IsSilentWhereNobodyListens) {
  const ServiceManager manager;
  EXPECT_FALSE(manager.listens());
  EXPECT_EQ(manager.watchdog_timeout(), absl::ZeroDuration());
  manager.Ready("works");
  manager.Stopping();
}

TEST_F(ServiceManagerTest, TellsAPathAndAnAbstractName) {
  for (const std::string& name : {Path(), absl::StrCat("@sheaf-test-", ::getpid())}) {
    const Listener listener(name);
    Set("NOTIFY_SOCKET", name);
    const ServiceManager manager;
    ASSERT_TRUE(manager.listens()) << name;
    manager.Ready("works for\nno farm");
    EXPECT_EQ(listener.Next(), "READY=1\nSTATUS=works for no farm");
    manager.Status("away");
    EXPECT_EQ(listener.Next(), "STATUS=away");
    manager.Stopping();
    EXPECT_EQ(listener.Next(), "STOPPING=1\nSTATUS=stopping");
  }
}

TEST_F(ServiceManagerTest, LeavesNothingToItsChildren) {
  const std::string path = Path();
  const Listener listener(path);
  Set("NOTIFY_SOCKET", path);
  Set("WATCHDOG_USEC", "5000000");
  Set("WATCHDOG_PID", absl::StrCat(::getpid()));
  const ServiceManager manager;
  EXPECT_EQ(manager.watchdog_timeout(), absl::Seconds(5));
  for (const char* name : {"NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"}) {
    EXPECT_EQ(std::getenv(name), nullptr) << name;
  }
}

TEST_F(ServiceManagerTest, AnotherProcessIsWatched) {
  const std::string path = Path();
  const Listener listener(path);
  Set("NOTIFY_SOCKET", path);
  Set("WATCHDOG_USEC", "5000000");
  Set("WATCHDOG_PID", absl::StrCat(::getpid() + 1));
  EXPECT_EQ(ServiceManager().watchdog_timeout(), absl::ZeroDuration());
}

TEST_F(ServiceManagerTest, NamesThatAreNoSocketsAreNotUsed) {
  for (const std::string name : {"@", "notify", "/nowhere/notify"}) {
    Set("NOTIFY_SOCKET", name);
    EXPECT_FALSE(ServiceManager().listens()) << name;
  }
  Set("NOTIFY_SOCKET", "/" + std::string(200, 'x'));
  EXPECT_FALSE(ServiceManager().listens());
}

TEST_F(ServiceManagerTest, TheWatchdogIsFedAsLongAsTheProgramLives) {
  const std::string path = Path();
  const Listener listener(path);
  Set("NOTIFY_SOCKET", path);
  Set("WATCHDOG_USEC", "20000");
  const ServiceManager manager;
  std::atomic<bool> lives{true};
  std::atomic<int> asked{0};
  const Watchdog watchdog(&manager, [&] {
    ++asked;
    return lives.load();
  });
  for (int i = 0; i < 3; ++i) EXPECT_EQ(listener.Next(), "WATCHDOG=1");
  lives = false;
  const int before = asked;
  while (asked < before + 2) absl::SleepFor(absl::Milliseconds(1));
  while (listener.Next(/*wait_ms=*/0).has_value()) {
  }
  const int silent_since = asked;
  while (asked < silent_since + 3) absl::SleepFor(absl::Milliseconds(1));
  EXPECT_EQ(listener.Next(/*wait_ms=*/0), std::nullopt);
}

}  // namespace
}  // namespace sheaf
