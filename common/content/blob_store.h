// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// BlobStore: a directory of blobs named by their SHA-256. Once Commit returns OK, a blob survives
// kill -9 and power loss. Several threads and several processes may use one directory.
//
// Disks, programs and users alter files. So a blob counts as present only while its bytes are known
// to match its name: they are digested when first requested, whenever the file's state has changed
// since, and once in kVerifiedAgeMax. A damaged blob is moved aside: it is then missing, and must
// be uploaded again by its next user.
//
//     DIR/ab/abcdef...        a complete, verified blob; never changes
//     DIR/partial/HEX.part    an upload in progress, or an interrupted one that can be resumed
//     DIR/damaged/HEX         a blob whose bytes no longer match its name, kept for diagnosis: the
//                             last kDamagedKeptMax, of kDamagedBytesMax together
//
// With an ObjectStore, each blob is also stored there, as "ab/abcdef...", before Commit returns OK.
// Blobs lost from the directory are fetched from there on request. Only one BlobStore may write to
// the ObjectStore. This part is in blob_store_objects.cc.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/base/digest.h"
#include "common/base/mutex.h"
#include "common/content/blob_digest.h"
#include "common/content/file_state.h"
#include "common/content/verified_files.h"
#include "common/objects/object_store.h"

namespace sheaf {

// Largest number of bytes in one message, before compression.
inline constexpr uint64_t kBlobChunkBytesMax = uint64_t{1} << 20;

// How much of a blob is present.
struct BlobWriteStatus {
  uint64_t committed_bytes = 0;  // Offset at which an upload resumes; size_bytes if complete.
  bool complete = false;
};

// A blob that was found for a client this recently, by FindMissing, GetWriteStatus, BeginWrite or
// Put, is not removed: clients ask which blobs are there and submit afterwards.
inline constexpr std::chrono::hours kAskedKept{1};

// A blob in the store, or an upload of one that is not complete, in which case `digest` has the
// size of what there is.
struct StoredBlob {
  BlobDigest digest;
  std::chrono::nanoseconds age{0};  // Since it was written, or asked for.
};

class BlobStore;

// One upload; holds the partial file's lock for its lifetime. If destroyed without Commit, it
// leaves the bytes appended so far to be resumed; but where the disk is full, it leaves nothing.
// Thread safety: one thread at a time.
class BlobWriter {
 public:
  ~BlobWriter();
  BlobWriter(BlobWriter&& other) noexcept;
  BlobWriter& operator=(BlobWriter&&) = delete;

  // Errors: kInvalidArgument beyond the blob's size; kResourceExhausted (disk full).
  absl::Status Append(std::string_view bytes);
  // Number of bytes in the partial file.
  uint64_t committed_bytes() const { return committed_bytes_; }
  // Makes the bytes so far durable. For interrupted uploads.
  absl::Status Flush();
  // Verifies size and digest, makes the blob durable and visible. Call once, last.
  // Errors: kInvalidArgument (too short: the bytes stay and can be resumed; or wrong digest: the
  // partial file is removed); kResourceExhausted (disk full).
  absl::Status Commit();
  // Removes the partial file. No other call may follow but committed_bytes.
  void Discard();

 private:
  friend class BlobStore;
  BlobWriter(const BlobStore* store, std::string partial_path, std::string final_path,
             BlobDigest digest, int fd)
      : store_(store),
        partial_path_(std::move(partial_path)),
        final_path_(std::move(final_path)),
        digest_(std::move(digest)),
        fd_(fd) {}
  absl::Status HashExistingBytes();
  // The error in errno. A full disk gets the bytes back.
  absl::Status Failed(const char* operation);

  const BlobStore* store_;
  std::string partial_path_, final_path_;
  BlobDigest digest_;
  int fd_ = -1;
  uint64_t committed_bytes_ = 0;
  Sha256 hash_;
};

// Thread safety: all members may be called concurrently.
class BlobStore {
 public:
  using Clock = VerifiedFiles::Clock;

  // Creates the directory if it is missing. objects: where blobs lie, too, which must outlive the
  // store; null: nowhere. Errors: of files, and of listing the objects.
  static absl::StatusOr<std::unique_ptr<BlobStore>> Open(
      const std::string& directory, std::function<Clock::time_point()> now = Clock::now,
      ObjectStore* objects = nullptr);

  // Returns the digests that are not stored (or are damaged, or have another size), in the order of
  // digests.
  // Errors: kInvalidArgument (malformed digest).
  absl::StatusOr<std::vector<BlobDigest>> FindMissing(const std::vector<BlobDigest>& digests) const;

  // Path of a complete blob, to be opened for reading only; and the file state in which its bytes
  // were verified.
  // Errors: kNotFound; kDataLoss (it was damaged, and is missing now); kInvalidArgument (malformed
  // digest, or stored with another size).
  absl::StatusOr<std::string> PathOf(const BlobDigest& digest) const;
  absl::StatusOr<FileState> StateOf(const BlobDigest& digest) const;

  // Errors: kInvalidArgument (malformed digest).
  absl::StatusOr<BlobWriteStatus> GetWriteStatus(const BlobDigest& digest) const;

  // Starts or resumes a write at offset_bytes. An offset of 0 always restarts.
  // Errors: kAlreadyExists (complete); kOutOfRange (neither 0 nor the offset from GetWriteStatus);
  // kUnavailable (another writer is active for this blob); kResourceExhausted (disk full).
  absl::StatusOr<BlobWriter> BeginWrite(const BlobDigest& digest, uint64_t offset_bytes) const;

  // Stores a small blob in one call; no effect if it is present.
  absl::StatusOr<BlobDigest> Put(std::string_view bytes) const;

  // At most size_bytes_max bytes from offset_bytes; empty at the end.
  // Errors: kNotFound; kOutOfRange (offset beyond the end).
  absl::StatusOr<std::string> ReadChunk(const BlobDigest& digest, uint64_t offset_bytes,
                                        uint64_t size_bytes_max) const;

  // Reads the whole blob and compares it with its name, even if its file was verified before.
  // Errors: kNotFound; kDataLoss (it was damaged, and is missing now).
  absl::Status Verify(const BlobDigest& digest) const;

  // Compares the blob's object with its name, and writes it again if it is damaged or lost. Returns
  // whether that was necessary; a no-op without an ObjectStore. Requires: Verify has returned OK.
  // Errors: those of files and of the ObjectStore.
  absl::StatusOr<bool> RepairObject(const BlobDigest& digest) const;

  // All blobs, and all uploads that are not complete, in no order. Does not verify them.
  std::vector<StoredBlob> List() const;
  std::vector<StoredBlob> ListUploads() const;
  // Removes a blob; false where it was asked for within kAskedKept, or is not there.
  bool Remove(const BlobDigest& digest) const;
  // Removes an upload; false if it is being written, or does not exist.
  bool RemoveUpload(const BlobDigest& digest) const;

  // The number of files digested for verification, for tests and metrics.
  uint64_t digest_count() const { return digest_count_; }
  // The blobs found damaged since the last call, or passed to NoteLost.
  std::vector<BlobDigest> TakeLost() const;
  // Records that a requested blob is missing although it should be present.
  void NoteLost(const BlobDigest& digest) const;

  // Makes the verified and durable file of a blob the blob: its object is stored, then the file is
  // renamed to its final name, which the caller makes durable. Errors: of files and of the
  // ObjectStore.
  absl::Status MakeVisible(const BlobDigest& digest, const std::string& partial_path) const;

  const std::string& directory() const { return directory_; }
  // The blob's path, whether it exists or not. Requires: CheckDigest is OK.
  std::string FinalPath(const BlobDigest& digest) const;
  std::string PartialPath(const BlobDigest& digest) const;

 private:
  friend class BlobWriter;
  BlobStore(std::string directory, std::function<Clock::time_point()> now, ObjectStore* objects)
      : directory_(std::move(directory)),
        now_(std::move(now)),
        objects_(objects),
        verified_(now_) {}
  // Notes which objects there are.
  absl::Status ListObjects();
  bool HasObject(const BlobDigest& digest) const;
  // Fetches the blob from its object. Errors: kNotFound (there is none); kDataLoss (it is damaged,
  // and counts as lost from now on); kUnavailable.
  absl::Status Restore(const BlobDigest& digest) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(LockOf(digest));
  absl::Status FetchTo(const BlobDigest& digest, const std::string& path) const;
  // The digest of an object's bytes. Errors: those of ObjectStore::GetRange.
  absl::StatusOr<std::string> DigestOfObject(const BlobDigest& digest) const;
  // Adds blobs of which there is an object alone.
  void AddObjects(std::vector<StoredBlob>* blobs) const;
  // Whether there was an object.
  bool RemoveObject(const BlobDigest& digest) const;
  Mutex* ObjectLockOf(const BlobDigest& digest) const;
  // Digests the file.
  absl::Status VerifyFile(const BlobDigest& digest) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(LockOf(digest));
  void TakeOut(const BlobDigest& digest, const FileState& state) const;
  // Whether it is there for a client that asks; then it counts as asked for.
  bool HasFor(const BlobDigest& digest) const;
  void NoteAsked(const BlobDigest& digest) const;
  // Forgets blobs that were not requested within kAskedKept.
  void ForgetAsked(Clock::time_point now) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(asked_mutex_);
  Mutex* LockOf(const BlobDigest& digest) const;

  const std::string directory_;
  const std::function<Clock::time_point()> now_;
  ObjectStore* const objects_;
  mutable VerifiedFiles verified_;  // Keyed by digest.
  // By the first digit of the digest: one thread digests a blob while others wait for it.
  mutable std::array<Mutex, 16> verifying_;
  // Likewise: an object is either stored or removed.
  mutable std::array<Mutex, 16> storing_;
  struct KnownObject {
    uint64_t size_bytes = 0;
    absl::Time written;
  };
  mutable Mutex known_mutex_;
  mutable std::unordered_map<std::string, KnownObject> known_ ABSL_GUARDED_BY(known_mutex_);
  mutable std::atomic<uint64_t> digest_count_{0};
  mutable Mutex asked_mutex_;  // Also held while a blob is removed.
  // When blobs were last written or asked for, by digest.
  mutable std::unordered_map<std::string, Clock::time_point> asked_ ABSL_GUARDED_BY(asked_mutex_);
  mutable Mutex lost_mutex_;
  mutable std::vector<BlobDigest> lost_ ABSL_GUARDED_BY(lost_mutex_);  // At most kLostNotedMax.
};

}  // namespace sheaf
