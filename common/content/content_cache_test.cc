// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/content/content_cache.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <thread>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "common/base/file.h"
#include "common/content/cache_shortage.h"

namespace sheaf {
namespace {

class ContentCacheTest : public ::testing::Test {
 protected:
  void SetUp() override {
    directory_ = ::testing::TempDir() + "/content_cache_" +
                 ::testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(directory_);
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }

  std::unique_ptr<ContentCache> Open(uint64_t bytes_max) {
    return *ContentCache::Open(directory_, {bytes_max});
  }
  // A file whose bytes the fake origin has.
  ManifestFile File(const std::string& name, const std::string& bytes) {
    const BlobDigest digest{Sha256Hex(bytes), bytes.size()};
    origin_[digest.sha256_hex] = bytes;
    return {name, digest};
  }
  ContentCache::Fetch FromOrigin() {
    return [this](const BlobDigest& digest, uint64_t offset, const ContentCache::Append& append) {
      ++fetch_count_;
      return append(std::string_view(origin_.at(digest.sha256_hex)).substr(offset));
    };
  }

  std::string directory_;
  std::map<std::string, std::string> origin_;
  std::atomic<int> fetch_count_{0};
};

TEST_F(ContentCacheTest, PathsKeepTheFileExtension) {
  const std::unique_ptr<ContentCache> cache = Open(1000);
  const std::vector<ManifestFile> files = {
      File("room.pbrt", "Camera"), File("../a b/head.ply.gz", "ply"), File("copy.ply.gz", "ply")};
  absl::StatusOr<ContentLease> lease = cache->Acquire(files, FromOrigin(), {});
  ASSERT_TRUE(lease.ok()) << lease.status();
  EXPECT_EQ(fetch_count_, 2);
  const std::map<std::string, std::string>& paths = lease->local_paths();
  EXPECT_EQ(*ReadWholeFile(paths.at("room.pbrt")), "Camera");
  EXPECT_TRUE(paths.at("../a b/head.ply.gz").ends_with("-head.ply.gz"));
  EXPECT_EQ(*ReadWholeFile(paths.at("copy.ply.gz")), "ply");
}

TEST_F(ContentCacheTest, DownloadsOnceAcrossProcesses) {
  const std::vector<ManifestFile> files = {File("a", "aaaa")};
  ASSERT_TRUE(Open(1000)->Acquire(files, FromOrigin(), {}).ok());
  ASSERT_TRUE(Open(1000)->Acquire(files, FromOrigin(), {}).ok());
  EXPECT_EQ(fetch_count_, 1);
}

TEST_F(ContentCacheTest, EvictsTheLeastRecentlyUsed) {
  const std::unique_ptr<ContentCache> cache = Open(10);
  const ManifestFile a = File("a", "aaaa"), b = File("b", "bbbb"), c = File("c", "cccc");
  ASSERT_TRUE(cache->Acquire({a}, FromOrigin(), {}).ok());
  ::usleep(10'000);  // File times advance with the kernel's clock tick.
  ASSERT_TRUE(cache->Acquire({b}, FromOrigin(), {}).ok());
  ::usleep(10'000);
  ASSERT_TRUE(cache->Acquire({a}, FromOrigin(), {}).ok());
  ASSERT_TRUE(cache->Acquire({c}, FromOrigin(), {}).ok());
  EXPECT_TRUE(cache->blobs().PathOf(a.digest).ok());
  EXPECT_FALSE(cache->blobs().PathOf(b.digest).ok());
}

TEST_F(ContentCacheTest, NeverEvictsFilesInUse) {
  const std::unique_ptr<ContentCache> cache = Open(10), other_process = Open(10);
  const ManifestFile a = File("a", "aaaa"), b = File("b", "bbbbbbbb");
  {
    absl::StatusOr<ContentLease> lease = cache->Acquire({a}, FromOrigin(), {});
    ASSERT_TRUE(lease.ok());
    const absl::Status status = other_process->Acquire({b}, FromOrigin(), {}).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted);
    EXPECT_THAT(std::string(status.message()), ::testing::HasSubstr("--cache-bytes-max"));
    EXPECT_EQ(*ReadWholeFile(lease->local_paths().at("a")), "aaaa");
  }
  EXPECT_TRUE(other_process->Acquire({b}, FromOrigin(), {}).ok());
}

TEST_F(ContentCacheTest, RefusesASceneLargerThanTheLimit) {
  const absl::Status status =
      Open(10)->Acquire({File("big", "12345678901")}, FromOrigin(), {}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(fetch_count_, 0);
}

TEST_F(ContentCacheTest, SaysByHowMuchASceneDoesNotFit) {
  const std::unique_ptr<ContentCache> cache = Open(1000);
  const std::vector<ManifestFile> pinned = {File("a", std::string(600, 'a'))};
  const absl::StatusOr<ContentLease> lease = cache->Acquire(pinned, FromOrigin(), {});
  ASSERT_TRUE(lease.ok());
  const std::vector<ManifestFile> larger = {File("b", std::string(1200, 'b'))};
  EXPECT_EQ(ShortageOf(cache->Acquire(larger, FromOrigin(), {}).status()),
            (CacheShortage{1200, 1000}));
  const std::vector<ManifestFile> second = {pinned[0], File("c", std::string(700, 'c'))};
  EXPECT_EQ(ShortageOf(cache->Acquire(second, FromOrigin(), {}).status()),
            (CacheShortage{1300, 1000}));
  const std::vector<ManifestFile> third = {File("d", std::string(700, 'd'))};
  EXPECT_EQ(ShortageOf(cache->Acquire(third, FromOrigin(), {}).status()),
            (CacheShortage{700, 400}));
  EXPECT_EQ(fetch_count_, 1) << "nothing is fetched of what does not fit";
}

TEST_F(ContentCacheTest, ComparesASceneWithTheFreeSpace) {
  const std::unique_ptr<ContentCache> cache = Open(UINT64_MAX);
  // No file system has this much space; it is compared before the first byte.
  const std::vector<ManifestFile> files = {{"huge", {std::string(64, 'e'), uint64_t{1} << 60}}};
  const absl::Status status = cache->Acquire(files, FromOrigin(), {}).status();
  const std::optional<CacheShortage> shortage = ShortageOf(status);
  ASSERT_TRUE(shortage.has_value()) << status;
  EXPECT_EQ(shortage->needed_bytes, uint64_t{1} << 60);
  EXPECT_LT(shortage->room_bytes, uint64_t{1} << 60);
  EXPECT_EQ(fetch_count_, 0);
}

TEST_F(ContentCacheTest, WhatDoesNotFitEvictsNothing) {
  const std::unique_ptr<ContentCache> cache = Open(1000);
  const std::vector<ManifestFile> kept = {File("a", std::string(500, 'a'))};
  ASSERT_TRUE(cache->Acquire(kept, FromOrigin(), {}).ok());
  const std::vector<ManifestFile> larger = {File("b", std::string(1001, 'b'))};
  EXPECT_FALSE(cache->Acquire(larger, FromOrigin(), {}).ok());
  ASSERT_TRUE(cache->Acquire(kept, FromOrigin(), {}).ok());
  EXPECT_EQ(fetch_count_, 1);
}

TEST_F(ContentCacheTest, AnErrorOfADiskThatFillsIsAShortage) {
  const std::unique_ptr<ContentCache> cache = Open(1000);
  const std::vector<ManifestFile> files = {File("a", std::string(500, 'a'))};
  const auto refuse = [](const BlobDigest&, uint64_t, const ContentCache::Append&) {
    return absl::ResourceExhaustedError("a limit of the coordinator");
  };
  const absl::Status status = cache->Acquire(files, refuse, {}).status();
  EXPECT_FALSE(ShortageOf(status).has_value()) << "that is not the disk's: " << status;
}

TEST_F(ContentCacheTest, UsesTheBlobsOfALenderWhereTheyLie) {
  const std::string lender = directory_ + "-lender";
  std::filesystem::remove_all(lender);
  const auto store = BlobStore::Open(lender);
  ASSERT_TRUE(store.ok() && (*store)->Put("lent").ok());
  const auto cache = ContentCache::Open(directory_, {.bytes_max = 2, .lender = store->get()});
  ASSERT_TRUE(cache.ok());
  const std::vector<ManifestFile> files = {File("a.pbrt", "lent")};
  const absl::StatusOr<ContentLease> lease = (*cache)->Acquire(files, FromOrigin(), {});
  ASSERT_TRUE(lease.ok()) << lease.status();
  EXPECT_EQ(fetch_count_, 0);
  EXPECT_EQ(*ReadWholeFile(lease->local_paths().at("a.pbrt")), "lent");
  EXPECT_EQ((*store)->digest_count(), 0) << "the lender knows its bytes";
  EXPECT_TRUE((*cache)->CheckUnchanged(*lease).ok());
  EXPECT_FALSE((*cache)->blobs().PathOf(files[0].digest).ok()) << "there is no second copy";
  std::filesystem::remove_all(lender);
}

TEST_F(ContentCacheTest, ConcurrentRequestsShareADownload) {
  const std::vector<ManifestFile> files = {File("a", std::string(5000, 'a'))};
  std::vector<std::jthread> threads;
  std::atomic<int> ok_count{0};
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&] {
      const std::unique_ptr<ContentCache> cache = Open(100'000);
      if (cache->Acquire(files, FromOrigin(), {}).ok()) ++ok_count;
    });
  }
  threads.clear();
  EXPECT_EQ(ok_count, 4);
  EXPECT_EQ(fetch_count_, 1);
}

TEST_F(ContentCacheTest, ResumesAnInterruptedDownload) {
  const std::unique_ptr<ContentCache> cache = Open(1000);
  const ManifestFile file = File("a", "0123456789");
  const auto cut = [](const BlobDigest&, uint64_t, const ContentCache::Append& append) {
    const absl::Status status = append("01234");
    return status.ok() ? absl::UnavailableError("connection lost") : status;
  };
  EXPECT_EQ(cache->Acquire({file}, cut, {}).status().code(), absl::StatusCode::kUnavailable);
  uint64_t resumed_at = 0;
  const ContentCache::Fetch rest = [&](const BlobDigest&, uint64_t offset,
                                       const ContentCache::Append& append) {
    resumed_at = offset;
    return append("56789");
  };
  EXPECT_TRUE(cache->Acquire({file}, rest, {}).ok());
  EXPECT_EQ(resumed_at, 5u);
}

TEST_F(ContentCacheTest, InterruptedDownloadsCountAndAreEvicted) {
  const std::unique_ptr<ContentCache> cache = Open(12);
  const auto cut = [](const BlobDigest&, uint64_t, const ContentCache::Append& append) {
    const absl::Status status = append("01234567");
    return status.ok() ? absl::UnavailableError("connection lost") : status;
  };
  const ManifestFile cut_off = File("a", "0123456789");
  EXPECT_FALSE(cache->Acquire({cut_off}, cut, {}).ok());
  EXPECT_TRUE(cache->Acquire({File("b", "bbbbbbbb")}, FromOrigin(), {}).ok());
  EXPECT_EQ(cache->blobs().GetWriteStatus(cut_off.digest)->committed_bytes, 0u);
}

TEST_F(ContentCacheTest, RefusesWrongBytes) {
  const auto wrong = [](const BlobDigest&, uint64_t, const ContentCache::Append& append) {
    return append("bbbb");
  };
  EXPECT_EQ(Open(100)->Acquire({File("a", "aaaa")}, wrong, {}).status().code(),
            absl::StatusCode::kDataLoss);
}

TEST_F(ContentCacheTest, DownloadsADamagedBlobAgain) {
  const ManifestFile file = File("a", "aaaa");
  ASSERT_TRUE(Open(100)->Acquire({file}, FromOrigin(), {}).ok());
  const std::string path = *Open(100)->blobs().PathOf(file.digest);
  ::chmod(path.c_str(), 0644);
  std::ofstream(path, std::ios::binary) << "aaab";
  absl::StatusOr<ContentLease> lease = Open(100)->Acquire({file}, FromOrigin(), {});
  ASSERT_TRUE(lease.ok()) << lease.status();
  EXPECT_EQ(*ReadWholeFile(lease->local_paths().at("a")), "aaaa");
  EXPECT_EQ(fetch_count_, 2);
}

TEST_F(ContentCacheTest, DetectsAlteredFilesInUse) {
  const std::unique_ptr<ContentCache> cache = Open(100);
  const std::vector<ManifestFile> files = {File("a.pbrt", "aaaa"), File("b.png", "bbbb")};
  const absl::StatusOr<ContentLease> lease = cache->Acquire(files, FromOrigin(), {});
  ASSERT_TRUE(lease.ok()) << lease.status();
  EXPECT_TRUE(cache->CheckUnchanged(*lease).ok());
  // Concurrent use of a scene's files does not change them.
  ASSERT_TRUE(Open(100)->Acquire(files, FromOrigin(), {}).ok());
  EXPECT_TRUE(cache->CheckUnchanged(*lease).ok());
  const std::string path = *cache->blobs().PathOf(files[1].digest);
  struct stat before {};
  ::stat(path.c_str(), &before);
  ::chmod(path.c_str(), 0644);
  std::ofstream(path, std::ios::binary | std::ios::in) << "bbbc";
  const timespec times[2] = {before.st_atim, before.st_mtim};
  ::utimensat(AT_FDCWD, path.c_str(), times, 0);  // As if the file had not been changed.
  const absl::Status status = cache->CheckUnchanged(*lease);
  EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(status.message()), ::testing::HasSubstr("b.png"));
  const absl::StatusOr<ContentLease> again = cache->Acquire(files, FromOrigin(), {});
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(*ReadWholeFile(again->local_paths().at("b.png")), "bbbb");
  EXPECT_TRUE(cache->CheckUnchanged(*again).ok());
  EXPECT_FALSE(cache->CheckUnchanged(*lease).ok()) << "its bytes may have been read";
  EXPECT_EQ(fetch_count_, 3);
}

TEST_F(ContentCacheTest, DamagedFilesAreEvictedFirst) {
  const std::unique_ptr<ContentCache> cache = Open(10);
  const ManifestFile a = File("a", "aaaa"), b = File("b", "bbbbbb");
  ASSERT_TRUE(cache->Acquire({a}, FromOrigin(), {}).ok());
  const std::string path = *cache->blobs().PathOf(a.digest);
  ::chmod(path.c_str(), 0644);
  std::ofstream(path, std::ios::binary) << "aaab";
  ASSERT_TRUE(cache->Acquire({a}, FromOrigin(), {}).ok());
  ASSERT_TRUE(cache->Acquire({b}, FromOrigin(), {}).ok());
  EXPECT_TRUE(cache->blobs().PathOf(a.digest).ok());
  EXPECT_TRUE(std::filesystem::is_empty(directory_ + "/blobs/damaged"));
}

TEST_F(ContentCacheTest, FreesLeasesOfKilledProcesses) {
  const ManifestFile a = File("a", "aaaa"), b = File("b", "bbbbbbbb");
  const pid_t child = ::fork();
  if (child == 0) {
    const std::unique_ptr<ContentCache> cache = Open(10);
    absl::StatusOr<ContentLease> lease = cache->Acquire({a}, FromOrigin(), {});
    ::_exit(lease.ok() ? 0 : 1);  // No destructor runs, as after kill -9.
  }
  int result = 0;
  ::waitpid(child, &result, 0);
  ASSERT_EQ(result, 0);
  ASSERT_FALSE(std::filesystem::is_empty(directory_ + "/leases"));
  EXPECT_TRUE(Open(10)->Acquire({b}, FromOrigin(), {}).ok());
  EXPECT_TRUE(std::filesystem::is_empty(directory_ + "/leases"));
}

TEST_F(ContentCacheTest, LeasesHoldNoOpenFiles) {
  const auto open_files = [] {
    return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {});
  };
  const std::unique_ptr<ContentCache> cache = Open(1000);
  const auto before = open_files();
  std::vector<ContentLease> leases;
  for (int i = 0; i < 50; ++i) {
    absl::StatusOr<ContentLease> lease =
        cache->Acquire({File("a", absl::StrCat("scene ", i))}, FromOrigin(), {});
    ASSERT_TRUE(lease.ok()) << lease.status();
    leases.push_back(*std::move(lease));
  }
  EXPECT_EQ(open_files(), before);
  // Leased blobs are still safe from other processes.
  EXPECT_EQ(Open(1)->Acquire({File("b", "b")}, FromOrigin(), {}).status().code(),
            absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(*ReadWholeFile(leases.front().local_paths().at("a")), "scene 0");
}

TEST_F(ContentCacheTest, WaitingCanBeStopped) {
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(Open(100)->Acquire({File("a", "aaaa")}, FromOrigin(), stop.get_token()).status().code(),
            absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace sheaf
