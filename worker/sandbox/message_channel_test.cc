// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/sandbox/message_channel.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

#include <string>
#include <thread>

namespace sheaf::worker {
namespace {

class MessageChannelTest : public ::testing::Test {
 protected:
  MessageChannelTest() {
    ::signal(SIGPIPE, SIG_IGN);
    EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM, 0, ends_), 0);
  }
  MessageChannel Channel(int end, MessageLimits limits = {100, 1 << 24}) {
    return MessageChannel(FileDescriptor(ends_[end]), limits);
  }

  int ends_[2];
};

TEST_F(MessageChannelTest, CarriesMessagesWithBytes) {
  MessageChannel here = Channel(0), there = Channel(1);
  const std::string bytes(10'000'000, '\7');  // More than a socket's buffer holds.
  std::jthread sender([&] {
    EXPECT_TRUE(here.Send("first", bytes).ok());
    EXPECT_TRUE(here.Send("", "").ok());
  });
  const absl::StatusOr<MessageChannel::Received> first = there.Receive();
  ASSERT_TRUE(first.ok());
  EXPECT_EQ(first->message, "first");
  EXPECT_EQ(first->payload, bytes);
  EXPECT_EQ(there.Receive()->message, "");
}

TEST_F(MessageChannelTest, CarriesOpenFilesToEndsThatTakeThem) {
  MessageChannel here = Channel(0), there = Channel(1, {100, 100, true});
  int pipe_ends[2];
  ASSERT_EQ(::pipe(pipe_ends), 0);
  const FileDescriptor reader(pipe_ends[0]);
  FileDescriptor writer(pipe_ends[1]);
  EXPECT_TRUE(here.Send("none").ok());
  EXPECT_TRUE(here.Send("one", "bytes", writer.get()).ok());
  EXPECT_TRUE(here.Send("none").ok());
  writer.Close();
  EXPECT_FALSE(there.Receive()->file.ok());
  absl::StatusOr<MessageChannel::Received> received = there.Receive();
  ASSERT_TRUE(received.ok());
  EXPECT_EQ(received->message + received->payload, "onebytes");
  ASSERT_TRUE(received->file.ok());
  EXPECT_EQ(::write(received->file.get(), "!", 1), 1);
  char byte = 0;
  EXPECT_EQ(::read(reader.get(), &byte, 1), 1);
  EXPECT_EQ(byte, '!');
  EXPECT_FALSE(there.Receive()->file.ok());
}

TEST_F(MessageChannelTest, ClosesOpenFilesThatItDoesNotTake) {
  MessageChannel here = Channel(0), there = Channel(1);
  int pipe_ends[2];
  ASSERT_EQ(::pipe(pipe_ends), 0);
  const FileDescriptor reader(pipe_ends[0]);
  FileDescriptor writer(pipe_ends[1]);
  EXPECT_TRUE(here.Send("one", "", writer.get()).ok());
  writer.Close();
  EXPECT_EQ(there.Receive()->message, "one");
  char byte = 0;
  EXPECT_EQ(::read(reader.get(), &byte, 1), 0);  // No end to write to is open.
}

TEST_F(MessageChannelTest, RefusesMessagesBeyondItsLimits) {
  MessageChannel here = Channel(0), there = Channel(1, {10, 10});
  EXPECT_TRUE(here.Send("a message of more than ten bytes").ok());
  EXPECT_TRUE(absl::IsInvalidArgument(there.Receive().status()));
}

TEST_F(MessageChannelTest, RefusesBytesBeyondItsLimits) {
  MessageChannel here = Channel(0), there = Channel(1, {10, 10});
  EXPECT_TRUE(here.Send("", "more than ten bytes").ok());
  EXPECT_TRUE(absl::IsInvalidArgument(there.Receive().status()));
}

TEST_F(MessageChannelTest, ReportsAClosedEnd) {
  MessageChannel here = Channel(0);
  ::close(ends_[1]);
  EXPECT_TRUE(absl::IsOutOfRange(here.Receive().status()));
  EXPECT_FALSE(here.Send("hello").ok());
}

TEST_F(MessageChannelTest, ReportsAnEndWithinAMessage) {
  MessageChannel here = Channel(0);
  ASSERT_EQ(::write(ends_[1], "\5\0\0\0\0\0\0\0ab", 10), 10);
  ::close(ends_[1]);
  EXPECT_TRUE(absl::IsOutOfRange(here.Receive().status()));
}

}  // namespace
}  // namespace sheaf::worker
