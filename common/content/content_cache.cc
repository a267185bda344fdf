// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/content/content_cache.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <optional>
#include <set>
#include <system_error>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/file.h"
#include "common/base/load_phases.h"
#include "common/base/mutex.h"
#include "common/base/status.h"
#include "common/base/surroundings/disk_space.h"
#include "common/content/cache_files.h"
#include "common/content/cache_shortage.h"

namespace sheaf {
namespace {

namespace fs = std::filesystem;

// Interval at which a process checks whether another one's download of a blob is done.
constexpr std::chrono::milliseconds kDownloadPollInterval{50};
// How often a blob may vanish or appear concurrently before Acquire gives up.
constexpr int kDownloadAttemptsMax = 20;
constexpr size_t kLinkNameBytesMax = 100;
constexpr int kLeaseFoldersMax = 10'000;  // For processes with the same id.

void RemoveDirectoryTree(const std::string& path) {
  std::error_code ignored;  // The next process retries removals that fail now.
  fs::remove_all(path, ignored);
}

// "models/head.ply.gz" and 12 make "12-head.ply.gz": readable in messages, and with the extension
// by which image and mesh readers select the format. Names are untrusted; only harmless characters
// stay.
std::string LinkName(size_t index, const std::string& name) {
  std::string base = name.substr(name.rfind('/') + 1);
  if (base.size() > kLinkNameBytesMax) base = base.substr(base.size() - kLinkNameBytesMax);
  for (char& c : base) {
    const bool harmless = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                          (c >= '0' && c <= '9') || c == '.' || c == '-' || c == '_';
    if (!harmless) c = '_';
  }
  return absl::StrCat(index, "-", base);
}

absl::Status SetReserved(const std::string& lease_directory, uint64_t size_bytes) {
  const std::string path = absl::StrCat(lease_directory, "/reserved");
  const FileDescriptor file(::open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600));
  if (!file.ok() || ::ftruncate(file.get(), static_cast<off_t>(size_bytes)) != 0) {
    return StatusFromErrno(errno, absl::StrCat("reserving room in ", path));
  }
  return absl::OkStatus();
}

uint64_t Less(uint64_t bytes, uint64_t taken) { return bytes - std::min(bytes, taken); }

void NoteUse(const std::string& stamp) {
  const FileDescriptor file(::open(stamp.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600));
  if (file.ok()) ::futimens(file.get(), nullptr);
}

}  // namespace

// The folder of all leases of one cache object, under one lock.
class ContentLease::Folder {
 public:
  Folder(std::string path, FileDescriptor lock) : path_(std::move(path)), lock_(std::move(lock)) {}
  ~Folder() {
    RemoveDirectoryTree(path_);
    ::unlink(absl::StrCat(path_, ".lock").c_str());
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  const std::string& path() const { return path_; }

 private:
  const std::string path_;
  const FileDescriptor lock_;
};

ContentLease::~ContentLease() {
  if (!directory_.empty()) RemoveDirectoryTree(directory_);
}

ContentLease::ContentLease(ContentLease&& other) noexcept
    : directory_(std::exchange(other.directory_, std::string())),
      folder_(std::move(other.folder_)),
      local_paths_(std::move(other.local_paths_)),
      pinned_(std::move(other.pinned_)) {}

absl::StatusOr<std::unique_ptr<ContentCache>> ContentCache::Open(const std::string& directory,
                                                                 ContentCacheLimits limits) {
  for (const char* below : {"/leases", "/used", "/blobs"}) {
    if (absl::Status status = MakePrivateDirectory(absl::StrCat(directory, below)); !status.ok()) {
      return status;
    }
  }
  absl::StatusOr<std::unique_ptr<BlobStore>> blobs =
      BlobStore::Open(absl::StrCat(directory, "/blobs"));
  if (!blobs.ok()) return blobs.status();
  std::unique_ptr<ContentCache> cache(new ContentCache(directory, limits, *std::move(blobs)));
  absl::StatusOr<FileDescriptor> lock = cache->LockCache();
  if (!lock.ok()) return lock.status();
  cache->FreeDeadLeases();
  if (absl::Status status = cache->MakeLeaseFolder(); !status.ok()) return status;
  return cache;
}

absl::StatusOr<FileDescriptor> ContentCache::LockCache() const {
  const std::string path = absl::StrCat(directory_, "/lock");
  FileDescriptor file(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600));
  if (!file.ok()) return StatusFromErrno(errno, absl::StrCat("opening ", path));
  while (::flock(file.get(), LOCK_EX) != 0) {
    if (errno != EINTR) return StatusFromErrno(errno, absl::StrCat("locking ", path));
  }
  return file;
}

void ContentCache::FreeDeadLeases() const {
  const std::string leases = absl::StrCat(directory_, "/leases");
  for (const std::string& name : ListDirectory(leases)) {
    const std::string path = absl::StrCat(leases, "/", name);
    if (!name.ends_with(".lock")) continue;
    const FileDescriptor lock = LockIfFree(path);
    if (!lock.ok()) continue;
    RemoveDirectoryTree(path.substr(0, path.size() - 5));
    ::unlink(path.c_str());
  }
}

absl::Status ContentCache::MakeLeaseFolder() {
  // Process ids repeat, over time and between containers: ids in use are skipped.
  for (int attempt = 0; attempt < kLeaseFoldersMax; ++attempt) {
    const std::string path = absl::StrCat(directory_, "/leases/", ::getpid(), "-", attempt);
    const std::string lock_path = absl::StrCat(path, ".lock");
    FileDescriptor lock(::open(lock_path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
    if (!lock.ok() && errno == EEXIST) continue;
    if (!lock.ok() || ::flock(lock.get(), LOCK_EX | LOCK_NB) != 0) {
      return StatusFromErrno(errno, absl::StrCat("creating ", lock_path));
    }
    lease_folder_ = std::make_shared<ContentLease::Folder>(path, std::move(lock));
    return absl::OkStatus();
  }
  return absl::ResourceExhaustedError(
      absl::StrCat("content cache ", directory_, ": more than ", kLeaseFoldersMax, " users"));
}

absl::StatusOr<ContentLease> ContentCache::MakeLease() {
  uint64_t number = 0;
  {
    const MutexLock lock(&mutex_);
    number = lease_count_++;
  }
  ContentLease lease(absl::StrCat(lease_folder_->path(), "/", number), lease_folder_);
  if (absl::Status status = MakeDirectories(lease.directory_); !status.ok()) return status;
  return lease;
}

uint64_t ContentCache::FreeBytes() const {
  const std::optional<DiskSpace> space = DiskSpaceOf(directory_);
  if (!space) return UINT64_MAX;  // Unknown; a write tells.
  return Less(space->available_bytes,
              AtMostFractionOf(*space, kCacheFreeFractionMax, limits_.free_bytes_min));
}

absl::Status ContentCache::MakeRoom(uint64_t missing_bytes, uint64_t scene_bytes) const {
  uint64_t used_bytes = 0, reserved_bytes = 0, evictable_bytes = 0;
  std::vector<Evictable> evictable;
  ScanBlobs(directory_, blobs_->directory(), &used_bytes, &evictable);
  for (const std::string& lease : LeaseDirectories(directory_)) {
    reserved_bytes += SizeOf(absl::StrCat(lease, "/reserved"));
  }
  used_bytes += reserved_bytes;
  for (const Evictable& victim : evictable) evictable_bytes += victim.size_bytes;
  const uint64_t pinned_bytes = used_bytes - evictable_bytes;
  uint64_t free_bytes = Less(FreeBytes(), reserved_bytes);
  const uint64_t room = std::min(Less(limits_.bytes_max, pinned_bytes),
                                 free_bytes + std::min(evictable_bytes, UINT64_MAX - free_bytes));
  const auto lacks_room = [&] {
    return used_bytes + missing_bytes > limits_.bytes_max || missing_bytes > free_bytes;
  };
  std::sort(evictable.begin(), evictable.end(), UsedBefore);
  for (const Evictable& victim : evictable) {
    if (missing_bytes > room || !lacks_room()) break;
    if (!Evict(victim)) continue;
    used_bytes -= victim.size_bytes;
    free_bytes += std::min(victim.size_bytes, UINT64_MAX - free_bytes);
    ::unlink(StampPath(directory_, fs::path(victim.path).filename().string()).c_str());
  }
  if (!lacks_room()) return absl::OkStatus();
  const bool of_disk = pinned_bytes + missing_bytes <= limits_.bytes_max;
  const std::string why =
      of_disk ? absl::StrCat("its file system has ", room,
                             " left; free space on it or choose another folder (--cache-dir)")
              : absl::StrCat(pinned_bytes, " of ", limits_.bytes_max,
                             " are in use by loaded scenes; raise the cache's limit "
                             "(--cache-bytes-max)");
  return WithShortage(
      absl::ResourceExhaustedError(absl::StrCat("content cache ", directory_, ": ", missing_bytes,
                                                " bytes are needed and ", why)),
      {scene_bytes, scene_bytes - missing_bytes + room});
}

const BlobStore* ContentCache::StoreOf(const BlobDigest& digest) const {
  if (blobs_->StateOf(digest).ok()) return blobs_.get();
  const BlobStore* const lender = limits_.lender;
  return lender != nullptr && lender->StateOf(digest).ok() ? lender : nullptr;
}

absl::Status ContentCache::Link(const std::vector<ManifestFile>& files,
                                const std::vector<size_t>& indices, ContentLease* lease) {
  const BlobDigest& digest = files[indices.front()].digest;
  const BlobStore* const store = StoreOf(digest);
  if (store == nullptr) return absl::NotFoundError(digest.sha256_hex);
  const absl::StatusOr<FileState> state = store->StateOf(digest);
  if (!state.ok()) return absl::NotFoundError(state.status().message());
  // Relative to DIR/leases/ID/K.
  std::error_code error;
  const std::string blob =
      store == blobs_.get()
          ? absl::StrCat("../../../blobs/", digest.sha256_hex.substr(0, 2), "/", digest.sha256_hex)
          : fs::absolute(store->FinalPath(digest), error).string();
  for (const size_t i : indices) {
    const std::string path = absl::StrCat(lease->directory_, "/", LinkName(i, files[i].name));
    if (::symlink(blob.c_str(), path.c_str()) != 0 && errno != EEXIST) {
      return StatusFromErrno(errno,
                             absl::StrCat("linking ", path, " to ", blob,
                                          " (the cache needs a file system with symbolic links)"));
    }
    lease->local_paths_[files[i].name] = path;
  }
  lease->pinned_.push_back({files[indices.front()].name, digest, *state, store});
  NoteUse(StampPath(directory_, digest.sha256_hex));
  return absl::OkStatus();
}

absl::Status ContentCache::Download(const BlobDigest& digest, const Fetch& fetch,
                                    std::stop_token stop) {
  int races = 0;
  while (!stop.stop_requested()) {
    const absl::StatusOr<BlobWriteStatus> there = blobs_->GetWriteStatus(digest);
    if (!there.ok()) return there.status();
    if (there->complete) return absl::OkStatus();
    absl::StatusOr<BlobWriter> writer = blobs_->BeginWrite(digest, there->committed_bytes);
    if (writer.ok()) {
      absl::Status written;
      absl::Status status = fetch(digest, there->committed_bytes, [&](std::string_view bytes) {
        if (stop.stop_requested()) return absl::CancelledError("stopped");
        written = writer->Append(bytes);
        return written;
      });
      if (!written.ok()) return written;
      // In this class, this code is for the cache's own disk.
      if (absl::IsResourceExhausted(status)) return absl::UnavailableError(status.message());
      if (!status.ok()) return status;
      status = writer->Commit();
      if (!status.ok() && !absl::IsResourceExhausted(status)) {
        return absl::DataLossError(status.message());
      }
      return status;
    }
    if (absl::IsAlreadyExists(writer.status())) return absl::OkStatus();
    if (absl::IsUnavailable(writer.status())) {  // Another process is downloading it.
      std::this_thread::sleep_for(kDownloadPollInterval);
    } else if (!absl::IsOutOfRange(writer.status()) || ++races == kDownloadAttemptsMax) {
      return writer.status();
    }
  }
  return absl::CancelledError("stopped while fetching the scene");
}

absl::StatusOr<ContentLease> ContentCache::Acquire(const std::vector<ManifestFile>& files,
                                                   const Fetch& fetch, std::stop_token stop) {
  const PhaseTimer timer(LoadPhase::kFetch);
  FilesByDigest by_digest;
  uint64_t total_bytes = 0;
  for (size_t i = 0; i < files.size(); ++i) {
    if (absl::Status status = CheckDigest(files[i].digest); !status.ok()) return status;
    std::vector<size_t>& same = by_digest[files[i].digest.sha256_hex];
    if (same.empty()) total_bytes += files[i].digest.size_bytes;
    same.push_back(i);
  }
  if (total_bytes > limits_.bytes_max && limits_.lender == nullptr) {
    return WithShortage(absl::ResourceExhaustedError(
                            absl::StrCat("the scene's files have ", total_bytes,
                                         " bytes, more than the content cache's limit of ",
                                         limits_.bytes_max, "; raise it (--cache-bytes-max)")),
                        {total_bytes, limits_.bytes_max});
  }
  for (const auto& [hex, indices] : by_digest) {
    // Digests the blob if necessary before the cache is locked. A damaged blob is moved aside, and
    // downloaded again below.
    const BlobDigest& digest = files[indices.front()].digest;
    absl::Status present = blobs_->PathOf(digest).status();
    if (!present.ok() && limits_.lender != nullptr)
      present = limits_.lender->PathOf(digest).status();
    if (absl::IsUnavailable(present) || absl::IsPermissionDenied(present)) return present;
  }
  absl::StatusOr<ContentLease> lease = AcquireAll(files, by_digest, total_bytes, fetch, stop);
  // Also a lack of space for links and the like.
  if (absl::IsResourceExhausted(lease.status()) && !ShortageOf(lease.status())) {
    return WithShortage(lease.status(), {total_bytes, std::min(total_bytes - 1, FreeBytes())});
  }
  return lease;
}

absl::StatusOr<ContentLease> ContentCache::AcquireAll(const std::vector<ManifestFile>& files,
                                                      const FilesByDigest& by_digest,
                                                      uint64_t scene_bytes, const Fetch& fetch,
                                                      const std::stop_token& stop) {
  std::vector<std::string> missing;
  absl::StatusOr<ContentLease> lease = PinPresent(files, by_digest, scene_bytes, &missing);
  if (!lease.ok()) return lease.status();
  absl::Status status = DownloadMissing(files, by_digest, missing, fetch, stop, &*lease);
  if (!status.ok()) return status;
  return lease;
}

absl::Status ContentCache::CheckUnchanged(const ContentLease& lease) const {
  for (const ContentLease::Pinned& pinned : lease.pinned_) {
    const absl::StatusOr<FileState> state = pinned.store->StateOf(pinned.digest);
    if (state.ok() && *state == pinned.state) continue;
    return absl::DataLossError(absl::StrCat(
        "file ", pinned.name, " (blob ", pinned.digest.sha256_hex, ") was altered in the cache ",
        directory_, " while its scene was in use; it is checked, and fetched again if needed"));
  }
  return absl::OkStatus();
}

absl::StatusOr<ContentLease> ContentCache::PinPresent(const std::vector<ManifestFile>& files,
                                                      const FilesByDigest& by_digest,
                                                      uint64_t scene_bytes,
                                                      std::vector<std::string>* missing) {
  absl::StatusOr<FileDescriptor> lock = LockCache();
  if (!lock.ok()) return lock.status();
  FreeDeadLeases();
  absl::StatusOr<ContentLease> lease = MakeLease();
  if (!lease.ok()) return lease.status();
  uint64_t missing_bytes = 0;
  for (const auto& [hex, indices] : by_digest) {
    const absl::Status linked = Link(files, indices, &*lease);
    if (linked.ok()) continue;
    if (!absl::IsNotFound(linked)) return linked;
    missing->push_back(hex);
    missing_bytes += files[indices.front()].digest.size_bytes;
  }
  if (missing->empty()) return lease;
  if (absl::Status status = MakeRoom(missing_bytes, scene_bytes); !status.ok()) return status;
  if (absl::Status status = SetReserved(lease->directory_, missing_bytes); !status.ok()) {
    return status;
  }
  return lease;
}

absl::Status ContentCache::DownloadMissing(const std::vector<ManifestFile>& files,
                                           const FilesByDigest& by_digest,
                                           const std::vector<std::string>& missing,
                                           const Fetch& fetch, std::stop_token stop,
                                           ContentLease* lease) {
  uint64_t missing_bytes = 0;
  for (const std::string& hex : missing) {
    missing_bytes += files[by_digest.at(hex).front()].digest.size_bytes;
  }
  for (const std::string& hex : missing) {
    const std::vector<size_t>& indices = by_digest.at(hex);
    const BlobDigest& digest = files[indices.front()].digest;
    absl::Status linked = absl::NotFoundError("never tried");
    for (int attempt = 0; attempt < kDownloadAttemptsMax && absl::IsNotFound(linked); ++attempt) {
      if (absl::Status status = Download(digest, fetch, stop); !status.ok()) {
        return Annotate(status, absl::StrCat("file ", files[indices.front()].name));
      }
      const absl::StatusOr<FileDescriptor> lock = LockCache();
      if (!lock.ok()) return lock.status();
      linked = Link(files, indices,
                    lease);  // Not found: it was evicted since, so it is downloaded again.
    }
    if (!linked.ok()) return linked;
    missing_bytes -= digest.size_bytes;
    absl::Status reserved = SetReserved(lease->directory_, missing_bytes);
    if (!reserved.ok()) return reserved;
  }
  return absl::OkStatus();
}

}  // namespace sheaf
