// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A process with a folder that it may write to. The limits of a process without one are in the
// tests of sandboxed scenes.
#include "worker/sandbox/confinement.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <functional>
#include <string>

#include "common/base/file.h"
#include "common/content/file_descriptor.h"
#include "tests/support/temporary_path.h"

namespace sheaf::worker {
namespace {

constexpr int kUnconfined = 77;
constexpr uint64_t kFileBytesMax = 1'000;

bool CanOpen(const std::string& path, int flags) {
  return FileDescriptor(::open(path.c_str(), flags | O_CLOEXEC, 0600)).ok();
}

class ConfinementTest : public ::testing::TestWithParam<uint32_t> {
 protected:
  ConfinementTest() {
    std::filesystem::create_directories(folder_ + "/files");
    std::filesystem::create_directories(folder_ + "/scratch");
    EXPECT_TRUE(WriteFileOnce(folder_ + "/files/scene", "text").ok());
    EXPECT_TRUE(WriteFileOnce(folder_ + "/secret", "key").ok());
  }
  ~ConfinementTest() override { std::filesystem::remove_all(folder_); }

  // The exit code of a confined process that runs the step; kUnconfined where the system does not
  // permit the protections.
  int Run(const std::function<int()>& step) const {
    const pid_t child = ::fork();
    if (child == 0) {
      ::signal(SIGXFSZ, SIG_IGN);
      Confinement confinement;
      confinement.protections = Protections(GetParam());
      confinement.memory_bytes_max = uint64_t{1} << 30;
      confinement.files = {{folder_ + "/files", folder_ + "/files"}};
      confinement.writable_folder = folder_ + "/scratch";
      confinement.file_bytes_max = kFileBytesMax;
      Protections missing;
      ::_exit(Confine(confinement, &missing).ok() ? step() : kUnconfined);
    }
    int status = 0;
    while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
    }
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }
  const std::string folder_ =
      std::filesystem::canonical(::testing::TempDir()).string() + "/" +
      std::filesystem::path(sheaf::testing::TemporaryPath("confined")).filename().string();
};

TEST_P(ConfinementTest, AProcessWritesToItsFolderAndNowhereElse) {
  const int code = Run([this] {
    const std::string scratch = folder_ + "/scratch";
    if (!CanOpen(folder_ + "/files/scene", O_RDONLY)) return 1;
    if (::mkdir((scratch + "/made").c_str(), 0700) != 0) return 2;
    if (!CanOpen(scratch + "/made/file", O_WRONLY | O_CREAT)) return 3;
    if (CanOpen(folder_ + "/secret", O_RDONLY)) return 4;
    if (CanOpen(folder_ + "/files/other", O_WRONLY | O_CREAT)) return 5;
    if (CanOpen(folder_ + "/files/scene", O_WRONLY)) return 6;
    if (CanOpen("/etc/passwd", O_RDONLY)) return 7;
    if (CanOpen(folder_ + "/escaped", O_WRONLY | O_CREAT)) return 8;
    return ::chdir(folder_.c_str()) == 0 ? 0 : 9;
  });
  if (code == kUnconfined) GTEST_SKIP() << "the system does not permit the protections";
  EXPECT_EQ(code, 0);
  EXPECT_TRUE(std::filesystem::exists(folder_ + "/scratch/made/file")) << "it stays for others";
}

TEST_P(ConfinementTest, FilesHaveALimit) {
  const int code = Run([this] {
    const std::string path = folder_ + "/scratch/large";
    const FileDescriptor file(::open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600));
    const std::string bytes(kFileBytesMax, 'x');
    if (::write(file.get(), bytes.data(), bytes.size()) != static_cast<ssize_t>(bytes.size())) {
      return 1;
    }
    return ::write(file.get(), "x", 1) < 0 && errno == EFBIG ? 0 : 2;
  });
  if (code == kUnconfined) GTEST_SKIP() << "the system does not permit the protections";
  EXPECT_EQ(code, 0);
}

// All protections, and those that remain where namespaces, or Landlock, are forbidden.
INSTANTIATE_TEST_SUITE_P(Protections, ConfinementTest, ::testing::Values(7, 6, 5));

}  // namespace
}  // namespace sheaf::worker
