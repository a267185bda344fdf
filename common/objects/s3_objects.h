// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// S3Objects: an ObjectStore on a server that speaks S3, addressed by path (ENDPOINT/BUCKET/KEY).
//
// A request that fails in a way that passes (no connection, a broken one, 429, 500, 502, 503, 504,
// "SlowDown") is repeated, at most kS3AttemptsMax times; a body that is shorter than announced, or
// has another digest, likewise. Each upload carries its SHA-256 in the signature, so that the
// server refuses bytes that changed on the way.
// Source: Amazon S3 API Reference, and its variants in other servers (docs/object-storage.md).
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "common/objects/http_client.h"
#include "common/objects/object_store.h"
#include "common/objects/s3_options.h"

namespace sheaf {

inline constexpr int kS3AttemptsMax = 5;
inline constexpr absl::Duration kS3BackoffInitial = absl::Milliseconds(100);
inline constexpr absl::Duration kS3BackoffMax = absl::Seconds(2);
// An object above this size is sent in pieces of kS3PieceBytes; S3 takes at most 10,000 of them.
inline constexpr uint64_t kS3SinglePutBytesMax = uint64_t{64} << 20;
inline constexpr uint64_t kS3PieceBytes = uint64_t{16} << 20;
inline constexpr uint64_t kS3PiecesMax = 10'000;
// Limit of an object in memory.
inline constexpr uint64_t kS3ObjectBytesMax = uint64_t{1} << 34;
inline constexpr int kS3PageObjectsMax = 1000;  // S3's limit, also for one removal of many.
inline constexpr uint64_t kS3PageBytesMax = uint64_t{8} << 20;
// How long the holder may take to begin a PUT. A worker requests its tickets right before.
inline constexpr absl::Duration kS3TicketLifetime = absl::Minutes(15);

// One server and bucket, for several stores. Thread safety: Send may be called concurrently.
class S3Server {
 public:
  explicit S3Server(S3Options options);

  struct Call {
    std::string method = "GET";
    std::string key;  // Below the bucket, with the prefix; empty: the bucket itself.
    std::map<std::string, std::string> query = {};
    std::vector<std::pair<std::string, std::string>> headers = {};
    std::string_view body = {};
    uint64_t response_bytes_max = kHttpErrorBytesMax;
    std::vector<int> other_statuses = {};  // Answers, beside 2xx, that the caller understands.
  };
  // The answer of one call, after as many repetitions as it takes. Errors: those of ObjectStore,
  // kNotFound and kResourceExhausted.
  absl::StatusOr<HttpResponse> Send(const Call& call);

  const S3Options& options() const { return options_; }
  // "http://HOST:PORT/BUCKET/KEY" of the ticket to PUT an object with this digest.
  PutTicket TicketToPut(const std::string& key, const FileDigest& digest) const;
  ObjectCounts Counts() const;
  // A body that came whole, with other bytes, is asked for again.
  void NoteRetry() { ++retries_; }
  // Whether the server understands "If-None-Match: *", as far as is known.
  bool knows_conditions() const { return knows_conditions_; }
  void NoteNoConditions() { knows_conditions_ = false; }

 private:
  absl::Status ErrorOf(const Call& call, const HttpResponse& response) const;
  std::string Describe(const Call& call) const;

  const S3Options options_;
  const HttpSigning signing_;
  HttpClient http_;
  std::atomic<uint64_t> requests_{0}, retries_{0}, failures_{0};
  std::atomic<uint64_t> sent_bytes_{0}, received_bytes_{0};
  std::atomic<bool> knows_conditions_{true};
};

class S3Objects : public ObjectStore {
 public:
  // The keys below the folder, "parts" or "content", of the options' prefix. server must outlive
  // the object.
  S3Objects(S3Server* server, const std::string& folder);

  std::string Name() const override;
  absl::Status Put(const std::string& key, std::string_view bytes, PutMode mode) override;
  absl::Status PutFile(const std::string& key, const std::string& path) override;
  // Stored objects are already durable.
  absl::Status Sync() override { return absl::OkStatus(); }
  absl::StatusOr<std::string> Get(const std::string& key, const FileDigest& digest) override;
  absl::StatusOr<std::string> GetRange(const std::string& key, uint64_t offset_bytes,
                                       uint64_t size_bytes_max) override;
  absl::StatusOr<uint64_t> Head(const std::string& key) override;
  absl::Status List(const std::string& folder,
                    const std::function<void(const StoredObject&)>& visit) override;
  absl::StatusOr<std::vector<std::string>> ListFolders(const std::string& folder) override;
  absl::Status Remove(const std::string& key) override;
  absl::Status RemoveFolder(const std::string& folder) override;
  std::optional<PutTicket> TicketToPut(const std::string& key, const FileDigest& digest) override;
  std::optional<ObjectCounts> Counts() const override { return server_.Counts(); }

  // Whether the store can be listed, as a start wants to know. Errors: those of ObjectStore.
  absl::Status Check();

 private:
  // Reads a piece of the value to store. Errors: those of its source.
  using Reader =
      std::function<absl::StatusOr<std::string>(uint64_t offset_bytes, uint64_t size_bytes)>;
  absl::Status PutOnce(const std::string& key, std::string_view bytes, PutMode mode);
  absl::Status PutInPieces(const std::string& key, uint64_t size_bytes, const Reader& read);
  absl::StatusOr<std::vector<std::string>> PutPieces(const std::string& key,
                                                     const std::string& upload_id,
                                                     uint64_t size_bytes, const Reader& read);
  absl::Status CompleteUpload(const std::string& key, const std::string& upload_id,
                              const std::vector<std::string>& etags);
  // Visits the pages of a list. delimited: folders instead of the keys in them.
  absl::Status ForEachPage(const std::string& folder, bool delimited,
                           const std::function<void(const std::vector<StoredObject>&,
                                                    const std::vector<std::string>&)>& visit);
  absl::Status RemoveMany(const std::vector<std::string>& keys);

  S3Server& server_;
  const std::string prefix_;  // With a "/" at the end.
};

}  // namespace sheaf
