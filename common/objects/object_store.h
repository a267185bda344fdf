// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ObjectStore: where byte strings lie that never change, under the names that they have today: the
// parts of a farm, or the blobs of scenes. FolderObjects keeps them as files, S3Objects on a server
// that speaks S3.
//
// A key is a relative path of letters, digits, ".", "-" and "_", such as
// "7/1/0_0_32_32-0-16-AB.exr". A folder of keys is what they have in common up to a "/"; an empty
// one does not exist.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/base/digest.h"

namespace sheaf {

enum class PutMode { kReplace, kIfAbsent };

struct StoredObject {
  std::string key;
  uint64_t size_bytes = 0;
  absl::Time written;
};

// The permission to store one object with certain bytes, for a process without a key of the store:
// a PUT of the bytes to this URL, with these headers and Content-Length. Any holder can use it, so
// it is not logged.
struct PutTicket {
  std::string url;
  std::vector<std::pair<std::string, std::string>> headers;
};

// A store's requests to its server since the start.
struct ObjectCounts {
  uint64_t requests = 0;  // With repeated ones.
  uint64_t retries = 0;
  uint64_t failures = 0;  // Calls that failed after all repetitions, or at once.
  uint64_t sent_bytes = 0, received_bytes = 0;
};

// Thread safety: all members may be called concurrently. Calls repeat by themselves what may work
// the next time, within the limits that their store names.
// Errors of all calls, with the store's name and what to do: kUnavailable (network, disk or
// server), kPermissionDenied (the keys or the rights do not suffice), kFailedPrecondition (there is
// no such store), and those that the call names.
class ObjectStore {
 public:
  virtual ~ObjectStore() = default;

  // For people: a directory, or "s3://BUCKET/PREFIX".
  virtual std::string Name() const = 0;

  // Stores the object, as a whole or not at all; it is durable once a later Sync returns OK.
  // Errors: kAlreadyExists (kIfAbsent, and it is there; stores that cannot tell replace it);
  // kResourceExhausted (the store is full); kInvalidArgument (a malformed key).
  virtual absl::Status Put(const std::string& key, std::string_view bytes, PutMode mode) = 0;
  // The same for a file of any size. Errors: also those of reading the file.
  virtual absl::Status PutFile(const std::string& key, const std::string& path) = 0;
  // Makes durable what was stored before the call. Errors: kResourceExhausted.
  virtual absl::Status Sync() = 0;

  // The whole object. Errors: kNotFound; kDataLoss (other bytes than the digest's, each time).
  virtual absl::StatusOr<std::string> Get(const std::string& key, const FileDigest& digest) = 0;
  // At most size_bytes_max bytes from an offset; empty at the end. Not verified. Errors: kNotFound.
  virtual absl::StatusOr<std::string> GetRange(const std::string& key, uint64_t offset_bytes,
                                               uint64_t size_bytes_max) = 0;
  // The object's size. Errors: kNotFound.
  virtual absl::StatusOr<uint64_t> Head(const std::string& key) = 0;

  // Visits the objects whose keys begin with a folder ("7/", or "" for all), in any order.
  virtual absl::Status List(const std::string& folder,
                            const std::function<void(const StoredObject&)>& visit) = 0;
  // The names of the folders directly in a folder, without "/".
  virtual absl::StatusOr<std::vector<std::string>> ListFolders(const std::string& folder) = 0;

  // OK if it does not exist.
  virtual absl::Status Remove(const std::string& key) = 0;
  // Removes what begins with the folder. Requires: it is not empty.
  virtual absl::Status RemoveFolder(const std::string& folder) = 0;

  // None where only this process can store objects.
  virtual std::optional<PutTicket> TicketToPut(const std::string& key,
                                               const FileDigest& digest) = 0;

  // None if there is no server. Stores of one server share it.
  virtual std::optional<ObjectCounts> Counts() const = 0;
};

// Errors: kInvalidArgument, naming the fault.
absl::Status CheckObjectKey(const std::string& key);

}  // namespace sheaf
