// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/objects/s3_objects.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "common/base/log.h"
#include "common/base/status.h"
#include "common/objects/folder_objects.h"
#include "common/objects/s3_xml.h"

namespace sheaf {
namespace {

using S3Call = S3Server::Call;

std::string ChecksumHeader(std::string_view bytes) {
  return absl::Base64Escape(BytesOfHex(Sha256Hex(bytes)));
}

// The length that an answer to HEAD or to a range announces.
absl::StatusOr<uint64_t> LengthOf(const HttpResponse& response, const std::string& name) {
  const auto header = response.headers.find("content-length");
  uint64_t length = 0;
  if (header != response.headers.end() && absl::SimpleAtoi(header->second, &length)) return length;
  return absl::UnavailableError(name + ": the server's answer has no length");
}

}  // namespace

S3Objects::S3Objects(S3Server* server, const std::string& folder)
    : server_(*server),
      prefix_(absl::StrCat(server->options().prefix, server->options().prefix.empty() ? "" : "/",
                           folder, "/")) {}

std::string S3Objects::Name() const {
  return absl::StrCat("s3://", server_.options().bucket, "/",
                      prefix_.substr(0, prefix_.size() - 1));
}

absl::Status S3Objects::Check() {
  S3Call call;
  call.query = {{"list-type", "2"}, {"max-keys", "1"}, {"prefix", prefix_}};
  const absl::StatusOr<HttpResponse> answer = server_.Send(call);
  if (!answer.ok()) return answer.status();
  return ParseS3Page(answer->body).status();
}

absl::Status S3Objects::Put(const std::string& key, std::string_view bytes, PutMode mode) {
  if (absl::Status status = CheckObjectKey(key); !status.ok()) return status;
  if (bytes.size() <= kS3SinglePutBytesMax) return PutOnce(key, bytes, mode);
  if (mode == PutMode::kIfAbsent) {
    const absl::StatusOr<uint64_t> size_bytes = Head(key);
    if (size_bytes.ok()) return absl::AlreadyExistsError(Name() + "/" + key + ": exists already");
    if (!absl::IsNotFound(size_bytes.status())) return size_bytes.status();
  }
  return PutInPieces(key, bytes.size(), [bytes](uint64_t offset, uint64_t size) {
    return std::string(bytes.substr(offset, size));
  });
}

absl::Status S3Objects::PutOnce(const std::string& key, std::string_view bytes, PutMode mode) {
  S3Call call{"PUT", prefix_ + key};
  call.headers = {{"content-type", "application/octet-stream"},
                  {"x-amz-checksum-sha256", ChecksumHeader(bytes)}};
  call.body = bytes;
  const bool is_conditional = mode == PutMode::kIfAbsent && server_.knows_conditions();
  if (is_conditional) {
    call.headers.emplace_back("if-none-match", "*");
    call.other_statuses = {412, 501};
  }
  const absl::StatusOr<HttpResponse> answer = server_.Send(call);
  if (!answer.ok()) return answer.status();
  if (answer->status == 412) {
    return absl::AlreadyExistsError(Name() + "/" + key + ": exists already");
  }
  if (answer->status != 501) return absl::OkStatus();
  server_.NoteNoConditions();
  LogInfo(absl::StrCat(Name(), ": the server has no conditional PUT; it is no longer used"));
  return PutOnce(key, bytes, PutMode::kReplace);
}

absl::Status S3Objects::PutFile(const std::string& key, const std::string& path) {
  if (absl::Status status = CheckObjectKey(key); !status.ok()) return status;
  std::error_code error;
  const uint64_t size_bytes = std::filesystem::file_size(path, error);
  if (error) return StatusFromErrno(error.value(), path);
  if (size_bytes <= kS3SinglePutBytesMax) {
    const absl::StatusOr<std::string> bytes = ReadWholeFile(path, kS3SinglePutBytesMax);
    return bytes.ok() ? PutOnce(key, *bytes, PutMode::kReplace) : bytes.status();
  }
  const absl::StatusOr<std::unique_ptr<FolderObjects>> folder =
      FolderObjects::Open(std::filesystem::path(path).parent_path().string(), false);
  if (!folder.ok()) return folder.status();
  const std::string name = std::filesystem::path(path).filename().string();
  return PutInPieces(key, size_bytes, [&](uint64_t offset, uint64_t size) {
    return (*folder)->GetRange(name, offset, size);
  });
}

absl::Status S3Objects::PutInPieces(const std::string& key, uint64_t size_bytes,
                                    const Reader& read) {
  const absl::StatusOr<HttpResponse> begun = server_.Send(
      {"POST", prefix_ + key, {{"uploads", ""}}, {{"content-type", "application/octet-stream"}}});
  if (!begun.ok()) return begun.status();
  const absl::StatusOr<std::string> upload_id = ParseUploadId(begun->body);
  if (!upload_id.ok()) return upload_id.status();
  const absl::StatusOr<std::vector<std::string>> etags =
      PutPieces(key, *upload_id, size_bytes, read);
  absl::Status status = etags.status();
  if (status.ok()) status = CompleteUpload(key, *upload_id, *etags);
  if (!status.ok()) {
    // The pieces take room until they are removed.
    const absl::Status aborted =
        server_.Send({"DELETE", prefix_ + key, {{"uploadId", *upload_id}}}).status();
    if (!aborted.ok() && !absl::IsNotFound(aborted)) {
      LogWarning(absl::StrCat("an upload that failed leaves pieces: ", aborted.message()));
    }
    return status;
  }
  const absl::StatusOr<uint64_t> stored_bytes = Head(key);
  if (!stored_bytes.ok()) return stored_bytes.status();
  if (*stored_bytes == size_bytes) return absl::OkStatus();
  return absl::UnavailableError(absl::StrCat(Name(), "/", key, ": the server keeps ", *stored_bytes,
                                             " of ", size_bytes, " bytes"));
}

absl::StatusOr<std::vector<std::string>> S3Objects::PutPieces(const std::string& key,
                                                              const std::string& upload_id,
                                                              uint64_t size_bytes,
                                                              const Reader& read) {
  // Larger pieces where there would be too many.
  const uint64_t piece_bytes =
      std::max(kS3PieceBytes, (size_bytes + kS3PiecesMax - 1) / kS3PiecesMax);
  std::vector<std::string> etags;
  for (uint64_t offset = 0; offset < size_bytes; offset += piece_bytes) {
    const uint64_t wanted = std::min(piece_bytes, size_bytes - offset);
    const absl::StatusOr<std::string> piece = read(offset, wanted);
    if (!piece.ok()) return piece.status();
    if (piece->size() != wanted) {
      return absl::DataLossError(absl::StrCat(key, ": the file became shorter as it was read"));
    }
    S3Call call{"PUT", prefix_ + key};
    call.query = {{"partNumber", absl::StrCat(etags.size() + 1)}, {"uploadId", upload_id}};
    call.body = *piece;
    const absl::StatusOr<HttpResponse> answer = server_.Send(call);
    if (!answer.ok()) return answer.status();
    const auto etag = answer->headers.find("etag");
    if (etag == answer->headers.end()) {
      return absl::UnavailableError(Name() + ": the server names no ETag of a piece");
    }
    etags.push_back(etag->second);
  }
  return etags;
}

absl::Status S3Objects::CompleteUpload(const std::string& key, const std::string& upload_id,
                                       const std::vector<std::string>& etags) {
  const std::string body = FormatCompletedUpload(etags);
  S3Call call{
      "POST", prefix_ + key, {{"uploadId", upload_id}}, {{"content-type", "application/xml"}}};
  call.body = body;
  call.other_statuses = {404};  // An earlier attempt has completed it; its answer was lost.
  const absl::StatusOr<HttpResponse> answer = server_.Send(call);
  if (!answer.ok()) return answer.status();
  // S3 begins to answer with 200 before it knows.
  const S3Error error = ParseS3Error(answer->body);
  if (answer->status == 404 && error.code != "NoSuchUpload") {
    return absl::NotFoundError(absl::StrCat(Name(), "/", key, ": ", error.code));
  }
  if (answer->status == 404 || error.code.empty()) return absl::OkStatus();
  return absl::UnavailableError(
      absl::StrCat(Name(), "/", key, ": completing the upload: ", error.code, ": ", error.message));
}

absl::StatusOr<std::string> S3Objects::Get(const std::string& key, const FileDigest& digest) {
  absl::Status last;
  for (int attempt = 0; attempt < kS3AttemptsMax; ++attempt) {
    S3Call call{"GET", prefix_ + key};
    call.response_bytes_max = digest.size_bytes + 1;
    absl::StatusOr<HttpResponse> answer = server_.Send(call);
    if (absl::IsResourceExhausted(answer.status())) {
      return absl::DataLossError(std::string(answer.status().message()));
    }
    if (!answer.ok()) return answer.status();
    if (answer->body.size() == digest.size_bytes && Sha256Hex(answer->body) == digest.sha256_hex) {
      return std::move(answer->body);
    }
    last = absl::DataLossError(absl::StrCat(
        Name(), "/", key, ": the bytes do not match the digest under which they were stored (",
        answer->body.size(), " of ", digest.size_bytes, " bytes came)"));
    if (attempt + 1 < kS3AttemptsMax) server_.NoteRetry();
  }
  return last;
}

absl::StatusOr<std::string> S3Objects::GetRange(const std::string& key, uint64_t offset_bytes,
                                                uint64_t size_bytes_max) {
  if (size_bytes_max == 0) return std::string();
  S3Call call{"GET", prefix_ + key};
  call.headers = {
      {"range", absl::StrCat("bytes=", offset_bytes, "-", offset_bytes + size_bytes_max - 1)}};
  call.response_bytes_max = size_bytes_max;
  call.other_statuses = {416};
  absl::StatusOr<HttpResponse> answer = server_.Send(call);
  if (!answer.ok()) return answer.status();
  if (answer->status == 416) return std::string();
  if (answer->status == 206 || offset_bytes == 0) return std::move(answer->body);
  return absl::UnavailableError(Name() + ": the server does not answer with the range asked for");
}

absl::StatusOr<uint64_t> S3Objects::Head(const std::string& key) {
  const absl::StatusOr<HttpResponse> answer = server_.Send({"HEAD", prefix_ + key});
  if (!answer.ok()) return answer.status();
  return LengthOf(*answer, Name() + "/" + key);
}

absl::Status S3Objects::ForEachPage(
    const std::string& folder, bool delimited,
    const std::function<void(const std::vector<StoredObject>&, const std::vector<std::string>&)>&
        visit) {
  S3Call call;
  call.query = {{"list-type", "2"},
                {"max-keys", absl::StrCat(kS3PageObjectsMax)},
                {"prefix", prefix_ + folder}};
  if (delimited) call.query["delimiter"] = "/";
  call.response_bytes_max = kS3PageBytesMax;
  while (true) {
    const absl::StatusOr<HttpResponse> answer = server_.Send(call);
    if (!answer.ok()) return answer.status();
    absl::StatusOr<S3Page> page = ParseS3Page(answer->body);
    if (!page.ok()) return Annotate(page.status(), Name());
    for (StoredObject& object : page->objects) {
      if (!absl::StartsWith(object.key, prefix_)) {
        return absl::UnavailableError(Name() + ": the server lists keys that were not asked for");
      }
      object.key.erase(0, prefix_.size());
    }
    visit(page->objects, page->prefixes);
    if (page->next_token.empty()) return absl::OkStatus();
    call.query["continuation-token"] = page->next_token;
  }
}

absl::Status S3Objects::List(const std::string& folder,
                             const std::function<void(const StoredObject&)>& visit) {
  return ForEachPage(folder, /*delimited=*/false,
                     [&visit](const std::vector<StoredObject>& objects,
                              const std::vector<std::string>& /*folders*/) {
                       for (const StoredObject& object : objects) visit(object);
                     });
}

absl::StatusOr<std::vector<std::string>> S3Objects::ListFolders(const std::string& folder) {
  std::vector<std::string> names;
  const size_t skipped = prefix_.size() + folder.size();
  absl::Status listed = ForEachPage(
      folder, /*delimited=*/true,
      [&](const std::vector<StoredObject>& /*objects*/, const std::vector<std::string>& folders) {
        for (const std::string& path : folders) {
          if (path.size() > skipped + 1) {
            names.push_back(path.substr(skipped, path.size() - skipped - 1));
          }
        }
      });
  if (!listed.ok()) return listed;
  return names;
}

absl::Status S3Objects::Remove(const std::string& key) {
  const absl::Status removed = server_.Send({"DELETE", prefix_ + key}).status();
  return absl::IsNotFound(removed) ? absl::OkStatus() : removed;
}

absl::Status S3Objects::RemoveFolder(const std::string& folder) {
  if (folder.empty() || folder.back() != '/') {
    return absl::InvalidArgumentError(absl::StrCat("\"", folder, "\" is not the name of a folder"));
  }
  // Listed first: a list that changes as it is read may leave some out.
  std::vector<std::string> keys;
  absl::Status status =
      List(folder, [&keys](const StoredObject& object) { keys.push_back(object.key); });
  for (size_t begin = 0; status.ok() && begin < keys.size(); begin += kS3PageObjectsMax) {
    const size_t end = std::min(keys.size(), begin + kS3PageObjectsMax);
    status = RemoveMany({keys.begin() + static_cast<std::ptrdiff_t>(begin),
                         keys.begin() + static_cast<std::ptrdiff_t>(end)});
  }
  return status;
}

absl::Status S3Objects::RemoveMany(const std::vector<std::string>& keys) {
  std::vector<std::string> whole_keys;
  for (const std::string& key : keys) whole_keys.push_back(prefix_ + key);
  const std::string body = FormatRemovals(whole_keys);
  S3Call call{"POST", "", {{"delete", ""}}, {{"content-type", "application/xml"}}};
  call.headers.emplace_back("x-amz-checksum-sha256", ChecksumHeader(body));
  call.body = body;
  call.response_bytes_max = kS3PageBytesMax;
  call.other_statuses = {400, 404, 405, 411, 501};
  const absl::StatusOr<HttpResponse> answer = server_.Send(call);
  if (!answer.ok()) return answer.status();
  if (answer->status < 300) {
    const absl::StatusOr<std::vector<std::string>> failed = ParseFailedRemovals(answer->body);
    if (!failed.ok()) return Annotate(failed.status(), Name());
    if (failed->empty()) return absl::OkStatus();
    return absl::UnavailableError(absl::StrCat(
        Name(), ": ", failed->size(), " objects are not removed; the first: ", failed->front()));
  }
  // The server removes one at a time, or wants an MD5 of the list.
  for (const std::string& key : keys) {
    if (absl::Status removed = Remove(key); !removed.ok()) return removed;
  }
  return absl::OkStatus();
}

std::optional<PutTicket> S3Objects::TicketToPut(const std::string& key, const FileDigest& digest) {
  return server_.TicketToPut(prefix_ + key, digest);
}

}  // namespace sheaf
