// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/content/blob_store.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/base/file.h"
#include "common/base/status.h"
#include "common/content/file_descriptor.h"

namespace sheaf {
namespace {

// How often a partial file may be renamed between opening and locking it before the writer gives
// up.
constexpr int kLockAttemptsMax = 16;
constexpr size_t kReadBufferBytes = size_t{1} << 18;
constexpr size_t kLostNotedMax = 1000;

size_t FirstDigit(const std::string& hex) {
  const char digit = hex.front();
  return static_cast<size_t>(digit <= '9' ? digit - '0' : digit - 'a' + 10);
}

absl::Status SyncDirectory(const std::string& path) {
  const FileDescriptor directory(::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!directory.ok() || ::fsync(directory.get()) != 0) {
    return StatusFromErrno(errno, absl::StrCat("fsync of directory ", path));
  }
  return absl::OkStatus();
}

absl::StatusOr<size_t> ReadSome(int fd, char* buffer, size_t size, const std::string& path) {
  while (true) {
    const ssize_t n = ::read(fd, buffer, size);
    if (n >= 0) return static_cast<size_t>(n);
    if (errno != EINTR) return StatusFromErrno(errno, absl::StrCat("reading ", path));
  }
}

// Opens and locks the partial file. A file that was renamed to its final name between the two steps
// is another writer's finished blob by then, so the partial file is opened again.
absl::StatusOr<FileDescriptor> OpenAndLock(const std::string& path) {
  for (int attempt = 0; attempt < kLockAttemptsMax; ++attempt) {
    FileDescriptor file(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600));
    if (!file.ok()) return StatusFromErrno(errno, absl::StrCat("opening ", path));
    if (::flock(file.get(), LOCK_EX | LOCK_NB) != 0) {
      if (errno == EINTR) continue;
      return absl::UnavailableError(absl::StrCat(path, ": another process is writing this blob"));
    }
    struct stat opened {
    }, named{};
    if (::fstat(file.get(), &opened) == 0 && ::stat(path.c_str(), &named) == 0 &&
        opened.st_ino == named.st_ino && opened.st_dev == named.st_dev) {
      return file;
    }
  }
  return absl::UnavailableError(absl::StrCat(path, ": could not be locked"));
}

}  // namespace

BlobWriter::~BlobWriter() {
  if (fd_ >= 0) ::close(fd_);
}

void BlobWriter::Discard() {
  if (fd_ < 0) return;
  ::unlink(partial_path_.c_str());
  ::close(std::exchange(fd_, -1));
}

absl::Status BlobWriter::Failed(const char* operation) {
  absl::Status status = StatusFromErrno(errno, absl::StrCat(operation, " ", partial_path_));
  if (absl::IsResourceExhausted(status)) Discard();
  return status;
}

BlobWriter::BlobWriter(BlobWriter&& other) noexcept
    : store_(other.store_),
      partial_path_(std::move(other.partial_path_)),
      final_path_(std::move(other.final_path_)),
      digest_(std::move(other.digest_)),
      fd_(std::exchange(other.fd_, -1)),
      committed_bytes_(other.committed_bytes_),
      hash_(std::move(other.hash_)) {}

absl::Status BlobWriter::HashExistingBytes() {
  std::string buffer(kReadBufferBytes, '\0');
  while (true) {
    absl::StatusOr<size_t> n = ReadSome(fd_, buffer.data(), buffer.size(), partial_path_);
    if (!n.ok()) return n.status();
    if (*n == 0) return absl::OkStatus();
    hash_.Update(buffer.data(), *n);
    committed_bytes_ += *n;
  }
}

absl::Status BlobWriter::Append(std::string_view bytes) {
  SHEAF_CHECK(fd_ >= 0);
  if (bytes.size() > digest_.size_bytes - committed_bytes_) {
    return absl::InvalidArgumentError(absl::StrCat("blob ", digest_.sha256_hex, ": more than its ",
                                                   digest_.size_bytes, " bytes were sent"));
  }
  while (!bytes.empty()) {
    const ssize_t n = ::write(fd_, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return Failed("writing");
    hash_.Update(bytes.data(), static_cast<size_t>(n));
    committed_bytes_ += static_cast<uint64_t>(n);
    bytes.remove_prefix(static_cast<size_t>(n));
  }
  return absl::OkStatus();
}

absl::Status BlobWriter::Flush() {
  if (fd_ < 0) return absl::OkStatus();  // Nothing is left of it.
  if (::fdatasync(fd_) == 0) return absl::OkStatus();
  return Failed("fsync of");
}

absl::Status BlobWriter::Commit() {
  if (committed_bytes_ != digest_.size_bytes) {
    return absl::InvalidArgumentError(absl::StrCat("blob ", digest_.sha256_hex, ": ends after ",
                                                   committed_bytes_, " of ", digest_.size_bytes,
                                                   " bytes"));
  }
  if (const std::string actual = hash_.FinishHex(); actual != digest_.sha256_hex) {
    ::unlink(partial_path_.c_str());
    return absl::InvalidArgumentError(absl::StrCat("blob ", digest_.sha256_hex,
                                                   ": the bytes received have SHA-256 ", actual,
                                                   "; the file changed or was damaged in transit"));
  }
  ::fchmod(fd_, 0400);  // A blob never changes; the mode only helps to notice attempts.
  if (::fsync(fd_) != 0) return Failed("fsync of");
  if (absl::Status status = store_->MakeVisible(digest_, partial_path_); !status.ok()) {
    return status;
  }
  const std::string directory = final_path_.substr(0, final_path_.rfind('/'));
  if (absl::Status status = SyncDirectory(directory); !status.ok()) return status;
  if (const auto state = StateOfFile(final_path_)) {
    store_->verified_.Remember(digest_.sha256_hex, *state);
  }
  store_->NoteAsked(digest_);
  ::close(std::exchange(fd_, -1));
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<BlobStore>> BlobStore::Open(const std::string& directory,
                                                           std::function<Clock::time_point()> now,
                                                           ObjectStore* objects) {
  for (const char* below : {"partial", "damaged"}) {
    if (absl::Status status = MakeDirectories(absl::StrCat(directory, "/", below)); !status.ok()) {
      return status;
    }
  }
  std::unique_ptr<BlobStore> store(new BlobStore(directory, std::move(now), objects));
  if (absl::Status status = store->ListObjects(); !status.ok()) return status;
  return store;
}

std::string BlobStore::FinalPath(const BlobDigest& digest) const {
  return absl::StrCat(directory_, "/", digest.sha256_hex.substr(0, 2), "/", digest.sha256_hex);
}

std::string BlobStore::PartialPath(const BlobDigest& digest) const {
  return absl::StrCat(directory_, "/partial/", digest.sha256_hex, ".part");
}

absl::StatusOr<FileState> BlobStore::StateOf(const BlobDigest& digest) const {
  if (absl::Status status = CheckDigest(digest); !status.ok()) return status;
  const std::string path = FinalPath(digest);
  std::optional<FileState> state = StateOfFile(path);
  if (state ? !verified_.Contains(digest.sha256_hex, *state) : HasObject(digest)) {
    const MutexLock lock(LockOf(digest));
    state = StateOfFile(path);
    absl::Status status;
    if (state && !verified_.Contains(digest.sha256_hex, *state)) status = VerifyFile(digest);
    const bool is_lost = !state || absl::IsDataLoss(status);
    if (is_lost && HasObject(digest)) status = Restore(digest);
    if (!status.ok()) return status;
    state = StateOfFile(path);
  }
  if (!state) return StatusFromErrno(errno, absl::StrCat("blob ", digest.sha256_hex));
  if (state->size_bytes != digest.size_bytes) {
    return absl::InvalidArgumentError(absl::StrCat("blob ", digest.sha256_hex, ": stored with ",
                                                   state->size_bytes, " bytes, not the ",
                                                   digest.size_bytes, " that were announced"));
  }
  return *state;
}

absl::StatusOr<std::string> BlobStore::PathOf(const BlobDigest& digest) const {
  if (const absl::Status status = StateOf(digest).status(); !status.ok()) return status;
  return FinalPath(digest);
}

absl::StatusOr<std::vector<BlobDigest>> BlobStore::FindMissing(
    const std::vector<BlobDigest>& digests) const {
  std::vector<BlobDigest> missing;
  for (const BlobDigest& digest : digests) {
    if (absl::Status status = CheckDigest(digest); !status.ok()) return status;
    if (!HasFor(digest)) missing.push_back(digest);
  }
  return missing;
}

absl::StatusOr<BlobWriteStatus> BlobStore::GetWriteStatus(const BlobDigest& digest) const {
  if (absl::Status status = CheckDigest(digest); !status.ok()) return status;
  if (HasFor(digest)) return BlobWriteStatus{digest.size_bytes, true};
  struct stat found {};
  if (::stat(PartialPath(digest).c_str(), &found) != 0) return BlobWriteStatus{};
  // A partial file that is too long was written for another size: restart.
  const auto size = static_cast<uint64_t>(found.st_size);
  return BlobWriteStatus{size <= digest.size_bytes ? size : 0, false};
}

absl::StatusOr<BlobWriter> BlobStore::BeginWrite(const BlobDigest& digest,
                                                 uint64_t offset_bytes) const {
  if (absl::Status status = CheckDigest(digest); !status.ok()) return status;
  absl::StatusOr<FileDescriptor> file = OpenAndLock(PartialPath(digest));
  if (!file.ok()) return file.status();
  if (HasFor(digest)) {
    ::unlink(PartialPath(digest).c_str());
    return absl::AlreadyExistsError(absl::StrCat("blob ", digest.sha256_hex, " is complete"));
  }
  if (offset_bytes == 0 && ::ftruncate(file->get(), 0) != 0) {
    return StatusFromErrno(errno, absl::StrCat("truncating ", PartialPath(digest)));
  }
  BlobWriter writer(this, PartialPath(digest), FinalPath(digest), digest, file->Release());
  if (absl::Status status = writer.HashExistingBytes(); !status.ok()) return status;
  if (writer.committed_bytes() != offset_bytes || offset_bytes > digest.size_bytes) {
    return absl::OutOfRangeError(
        absl::StrCat("blob ", digest.sha256_hex, ": ", writer.committed_bytes(),
                     " bytes are there, the write began at ", offset_bytes));
  }
  return writer;
}

absl::StatusOr<BlobDigest> BlobStore::Put(std::string_view bytes) const {
  BlobDigest digest{Sha256Hex(bytes), bytes.size()};
  if (HasFor(digest)) return digest;
  absl::StatusOr<BlobWriter> writer = BeginWrite(digest, 0);
  if (writer.status().code() == absl::StatusCode::kAlreadyExists) return digest;
  if (!writer.ok()) return writer.status();
  if (absl::Status status = writer->Append(bytes); !status.ok()) return status;
  if (absl::Status status = writer->Commit(); !status.ok()) return status;
  return digest;
}

absl::StatusOr<std::string> BlobStore::ReadChunk(const BlobDigest& digest, uint64_t offset_bytes,
                                                 uint64_t size_bytes_max) const {
  const absl::StatusOr<std::string> path = PathOf(digest);
  if (!path.ok()) return path.status();
  if (offset_bytes > digest.size_bytes) {
    return absl::OutOfRangeError(absl::StrCat("blob ", digest.sha256_hex, ": offset ", offset_bytes,
                                              " is beyond its ", digest.size_bytes, " bytes"));
  }
  const FileDescriptor file(::open(path->c_str(), O_RDONLY | O_CLOEXEC));
  if (!file.ok()) return StatusFromErrno(errno, *path);
  if (::lseek(file.get(), static_cast<off_t>(offset_bytes), SEEK_SET) < 0) {
    return StatusFromErrno(errno, *path);
  }
  std::string bytes(std::min(size_bytes_max, digest.size_bytes - offset_bytes), '\0');
  size_t filled = 0;
  while (filled < bytes.size()) {
    absl::StatusOr<size_t> n =
        ReadSome(file.get(), bytes.data() + filled, bytes.size() - filled, *path);
    if (!n.ok()) return n.status();
    if (*n == 0) return absl::DataLossError(absl::StrCat(*path, ": shorter than its name says"));
    filled += *n;
  }
  return bytes;
}

absl::Status BlobStore::Verify(const BlobDigest& digest) const {
  if (absl::Status status = CheckDigest(digest); !status.ok()) return status;
  const MutexLock lock(LockOf(digest));
  return VerifyFile(digest);
}

absl::Status BlobStore::VerifyFile(const BlobDigest& digest) const {
  const std::string path = FinalPath(digest);
  ++digest_count_;
  const std::optional<FileState> before = StateOfFile(path);
  const absl::StatusOr<FileDigest> actual = Sha256OfFile(path);
  if (!actual.ok()) return actual.status();
  const std::optional<FileState> after = StateOfFile(path);
  if (actual->sha256_hex == digest.sha256_hex) {
    if (!before || before != after) {
      return absl::UnavailableError(absl::StrCat(path, ": changed while it was read; try again"));
    }
    verified_.Remember(digest.sha256_hex, *before);
    return absl::OkStatus();
  }
  if (after) TakeOut(digest, *after);
  return absl::DataLossError(absl::StrCat("blob ", digest.sha256_hex, ": the bytes stored as ",
                                          path, " are damaged and were moved to ", directory_,
                                          "/damaged"));
}

void BlobStore::TakeOut(const BlobDigest& digest, const FileState& state) const {
  const std::string path = FinalPath(digest);
  // Another process may have restored it meanwhile.
  const std::optional<FileState> now = StateOfFile(path);
  if (!now || now->inode != state.inode) return;
  verified_.Forget(digest.sha256_hex);
  MoveAside(path, absl::StrCat(directory_, "/damaged"), digest.sha256_hex);
  NoteLost(digest);
}

std::vector<BlobDigest> BlobStore::TakeLost() const {
  const MutexLock lock(&lost_mutex_);
  return std::exchange(lost_, {});
}

void BlobStore::NoteLost(const BlobDigest& digest) const {
  const MutexLock lock(&lost_mutex_);
  if (lost_.size() < kLostNotedMax) lost_.push_back(digest);
}

Mutex* BlobStore::LockOf(const BlobDigest& digest) const {
  return &verifying_[FirstDigit(digest.sha256_hex)];
}

Mutex* BlobStore::ObjectLockOf(const BlobDigest& digest) const {
  return &storing_[FirstDigit(digest.sha256_hex)];
}

}  // namespace sheaf
