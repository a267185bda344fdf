// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Joins two network namespaces by a link that delays and loses packets, with a TUN device at each
// end: kernels without the netem queue have no other.
//
//   sheaf_slow_tunnel CONTROL OTHER_NAMESPACE ADDRESS OTHER_ADDRESS
//
// One end is in this process's namespace, the other one in that of the file OTHER_NAMESPACE; both
// devices are named "tunnel0" and have their addresses. CONTROL is a file of four int64 that may
// change at any time: delay and jitter of a packet in microseconds, and how many of a thousand
// packets are lost on the way there and on the way back. Prints "up" when packets flow.
#include <fcntl.h>
#include <linux/if.h>
#include <linux/if_tun.h>
#include <poll.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <random>
#include <string>
#include <vector>

namespace {

using Clock = std::chrono::steady_clock;

constexpr size_t kPacketBytesMax = 2048;
constexpr int kMtuBytes = 1400;
constexpr size_t kQueueMax = 1 << 14;  // Packets on the way in one direction; more are lost.

struct Control {
  int64_t delay_us = 0, jitter_us = 0;
  int64_t lost_per_mille[2] = {0, 0};
};

struct Packet {
  Clock::time_point due;
  std::vector<char> bytes;
};

[[noreturn]] void Fail(const char* what) {
  std::perror(what);
  std::exit(1);
}

const volatile Control& MapControl(const char* path) {
  const int file = ::open(path, O_RDONLY | O_CLOEXEC);
  if (file < 0) Fail(path);
  const void* mapped = ::mmap(nullptr, sizeof(Control), PROT_READ, MAP_SHARED, file, 0);
  if (mapped == MAP_FAILED) Fail(path);
  return *static_cast<const volatile Control*>(mapped);
}

// A device in the namespace that the calling thread is in.
int OpenDevice(const std::string& address, const std::string& other_address) {
  const int device = ::open("/dev/net/tun", O_RDWR | O_CLOEXEC | O_NONBLOCK);
  if (device < 0) Fail("/dev/net/tun");
  ifreq request{};
  request.ifr_flags = IFF_TUN | IFF_NO_PI;
  std::strncpy(request.ifr_name, "tunnel0", IFNAMSIZ - 1);
  if (::ioctl(device, TUNSETIFF, &request) != 0) Fail("TUNSETIFF");
  const std::string configure = "ip addr add " + address + " peer " + other_address +
                                " dev tunnel0 && ip link set tunnel0 up mtu " +
                                std::to_string(kMtuBytes);
  if (std::system(configure.c_str()) != 0) Fail("ip");
  return device;
}

// One direction: packets read from a device, on their way to the other one.
class Direction {
 public:
  Direction(int from, int to, size_t index, const volatile Control& control)
      : from_(from), to_(to), index_(index), control_(control) {}

  void Receive() {
    std::array<char, kPacketBytesMax> buffer;
    for (ssize_t got = 0; (got = ::read(from_, buffer.data(), buffer.size())) > 0;) {
      if (Draw(1000) < control_.lost_per_mille[index_] || packets_.size() >= kQueueMax) continue;
      const int64_t jitter =
          control_.jitter_us == 0 ? 0 : Draw(2 * control_.jitter_us + 1) - control_.jitter_us;
      Clock::time_point due = Clock::now() + std::chrono::microseconds(control_.delay_us + jitter);
      if (!packets_.empty()) due = std::max(due, packets_.back().due);  // In order.
      packets_.push_back({due, {buffer.data(), buffer.data() + got}});
    }
  }
  void Deliver(Clock::time_point now) {
    for (; !packets_.empty() && packets_.front().due <= now; packets_.pop_front()) {
      const std::vector<char>& bytes = packets_.front().bytes;
      // A device that is down loses it.
      [[maybe_unused]] const ssize_t sent = ::write(to_, bytes.data(), bytes.size());
    }
  }
  Clock::time_point NextDue() const {
    return packets_.empty() ? Clock::time_point::max() : packets_.front().due;
  }

 private:
  int64_t Draw(int64_t count) {
    return static_cast<int64_t>(random_() % static_cast<uint64_t>(count));
  }

  const int from_, to_;
  const size_t index_;
  const volatile Control& control_;
  std::mt19937_64 random_;
  std::deque<Packet> packets_;
};

int TimeoutMs(Clock::time_point due) {
  if (due == Clock::time_point::max()) return -1;
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(due - Clock::now());
  return static_cast<int>(std::max<int64_t>(left.count(), 0));
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 5) {
    std::fprintf(stderr, "usage: sheaf_slow_tunnel CONTROL OTHER_NAMESPACE ADDRESS ADDRESS\n");
    return 2;
  }
  const volatile Control& control = MapControl(arguments[1]);
  const int here = OpenDevice(arguments[3], arguments[4]);
  const int other = ::open(arguments[2], O_RDONLY | O_CLOEXEC);
  if (other < 0 || ::setns(other, CLONE_NEWNET) != 0) Fail(arguments[2]);
  const int there = OpenDevice(arguments[4], arguments[3]);
  std::puts("up");
  std::fflush(stdout);
  std::array<Direction, 2> directions{Direction(here, there, 0, control),
                                      Direction(there, here, 1, control)};
  while (true) {
    std::array<pollfd, 2> devices{pollfd{here, POLLIN, 0}, pollfd{there, POLLIN, 0}};
    const Clock::time_point due = std::min(directions[0].NextDue(), directions[1].NextDue());
    ::poll(devices.data(), devices.size(), TimeoutMs(due));
    if ((devices[0].revents & POLLERR) != 0 || (devices[1].revents & POLLERR) != 0) {
      ::usleep(1000);  // A device that is down.
    }
    for (Direction& direction : directions) {
      direction.Receive();
      direction.Deliver(Clock::now());
    }
  }
}
