// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/bundle/bundle_file.h"

#include <google/protobuf/util/json_util.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/status.h"
#include "common/content/chunk_codec.h"
#include "common/rpc/manifest_codec.h"
#include "common/scene/settings/render_settings.h"
#include "worker/wire/coordinator_messages.h"

namespace sheaf::cli {
namespace {

constexpr char kTaskName[] = "task.json", kSumsName[] = "SHA256SUMS", kFolder[] = "files/";

std::string FileName(const std::string& sha256_hex) { return absl::StrCat(kFolder, sha256_hex); }

// A line as sha256sum prints it.
std::string SumLine(const std::string& sha256_hex, const std::string& name) {
  return absl::StrCat(sha256_hex, "  ", name, "\n");
}

absl::Status OutOfOrder() {
  return absl::DataLossError("the coordinator's messages are out of order; is it another version?");
}

// The task as the coordinator would lease it. Errors: kInvalidArgument.
absl::StatusOr<worker::Lease> LeaseOf(const v1::TaskBundle& task) {
  v1::SynchronizeResponse response;
  v1::Lease& lease = *response.add_leases();
  lease.set_frame_name(task.frame_name());
  *lease.mutable_key() = task.key();
  *lease.mutable_scene() = task.scene();
  *lease.mutable_settings() = task.settings();
  if (task.has_guiding_field()) *lease.mutable_guiding_field() = task.guiding_field();
  absl::StatusOr<worker::DesiredState> checked = worker::FromWire(response);
  if (!checked.ok()) return checked.status();
  return std::move(checked->leases[0]);
}

}  // namespace

BundleWriter::BundleWriter(std::string path, std::string version)
    : path_(std::move(path)),
      partial_path_(absl::StrCat(path_, ".partial-", ::getpid())),
      version_(std::move(version)) {}

BundleWriter::~BundleWriter() {
  std::error_code ignored;  // It does not exist if Finish has returned OK.
  if (tar_ != nullptr) std::filesystem::remove(partial_path_, ignored);
}

absl::Status BundleWriter::Begin(const v1::TaskBundle& task) {
  task_ = task;
  task_.set_version(version_);
  const absl::Time now = absl::Now();
  task_.mutable_create_time()->set_seconds(absl::ToUnixSeconds(now));
  google::protobuf::util::JsonPrintOptions options;
  options.add_whitespace = true;
  options.preserve_proto_field_names = true;
  std::string json;
  const auto printed = google::protobuf::util::MessageToJsonString(task_, &json, options);
  if (!printed.ok()) return absl::DataLossError("the coordinator sent a task that is not text");
  absl::StatusOr<std::unique_ptr<TarWriter>> tar = TarWriter::Create(partial_path_);
  if (!tar.ok()) return tar.status();
  tar_ = *std::move(tar);
  file_ = {};
  size_bytes_ = json.size();
  sums_ = SumLine(Sha256Hex(json), kTaskName);
  if (absl::Status status = tar_->Begin(kTaskName, json.size()); !status.ok()) return status;
  return tar_->Append(json);
}

absl::Status BundleWriter::EndFile() {
  if (file_.sha256_hex.empty()) return absl::OkStatus();
  if (tar_->bytes_left() > 0 || hash_->FinishHex() != file_.sha256_hex) {
    return absl::DataLossError(absl::StrCat(
        "the bytes of file ", file_.sha256_hex,
        " do not match their digest; the coordinator's copy is damaged, or was cut short"));
  }
  sums_ += SumLine(file_.sha256_hex, FileName(file_.sha256_hex));
  file_ = {};
  return absl::OkStatus();
}

absl::Status BundleWriter::Take(const v1::ReadTaskBundleResponse& message) {
  if (message.has_bundle()) return Begin(message.bundle());
  if (tar_ == nullptr) return OutOfOrder();
  if (message.has_file()) {
    if (absl::Status status = EndFile(); !status.ok()) return status;
    file_ = {message.file().sha256_hex(), message.file().size_bytes()};
    if (!IsSha256Hex(file_.sha256_hex)) return OutOfOrder();
    hash_ = std::make_unique<Sha256>();
    const std::string name = FileName(file_.sha256_hex);
    if (absl::Status status = tar_->Begin(name, file_.size_bytes); !status.ok()) return status;
  }
  if (file_.sha256_hex.empty()) return OutOfOrder();
  const absl::StatusOr<std::string> bytes =
      DecompressChunk(message.zstd_chunk(), kBlobChunkBytesMax);
  if (!bytes.ok()) return absl::DataLossError(bytes.status().message());
  hash_->Update(*bytes);
  size_bytes_ += bytes->size();
  return tar_->Append(*bytes);
}

absl::Status BundleWriter::Finish() {
  if (tar_ == nullptr) return OutOfOrder();
  if (absl::Status status = EndFile(); !status.ok()) return status;
  if (absl::Status status = tar_->Begin(kSumsName, sums_.size()); !status.ok()) return status;
  if (absl::Status status = tar_->Append(sums_); !status.ok()) return status;
  if (absl::Status status = tar_->Finish(); !status.ok()) return status;
  if (std::rename(partial_path_.c_str(), path_.c_str()) != 0) {
    return StatusFromErrno(errno, absl::StrCat("writing ", path_));
  }
  tar_.reset();
  return absl::OkStatus();
}

absl::StatusOr<Bundle> Bundle::Open(ReadBytesAt read, uint64_t size_bytes) {
  const absl::StatusOr<std::vector<TarEntry>> entries = ListTar(read, size_bytes, kBundleFilesMax);
  if (!entries.ok()) return entries.status();
  Bundle bundle(std::move(read));
  if (absl::Status status = bundle.Verify(*entries); !status.ok()) return status;
  if (absl::Status status = bundle.ReadTask(entries->front()); !status.ok()) return status;
  if (absl::Status status = bundle.ReadManifest(); !status.ok()) return status;
  return bundle;
}

absl::Status Bundle::Verify(const std::vector<TarEntry>& entries) {
  if (entries.size() < 3 || entries.front().name != kTaskName || entries.back().name != kSumsName) {
    return absl::DataLossError(
        "it is not a file of sheaf bundle: task.json or SHA256SUMS is "
        "missing");
  }
  std::string sums;
  for (size_t i = 0; i + 1 < entries.size(); ++i) {
    const TarEntry& entry = entries[i];
    Sha256 hash;
    for (uint64_t at = 0; at < entry.size_bytes; at += kBlobChunkBytesMax) {
      const absl::StatusOr<std::string> bytes =
          read_(entry.offset_bytes + at, std::min(kBlobChunkBytesMax, entry.size_bytes - at));
      if (!bytes.ok()) return bytes.status();
      hash.Update(*bytes);
    }
    const std::string digest = hash.FinishHex();
    sums += SumLine(digest, entry.name);
    if (i == 0) continue;
    if (entry.name != FileName(digest) || !files_.emplace(digest, entry).second) {
      return absl::DataLossError(
          absl::StrCat("file ", i, " of it was altered: its bytes do not match its name"));
    }
  }
  if (entries.back().size_bytes != sums.size()) {
    return absl::DataLossError("SHA256SUMS does not list the files of it");
  }
  const absl::StatusOr<std::string> stated = read_(entries.back().offset_bytes, sums.size());
  if (!stated.ok()) return stated.status();
  if (*stated != sums) return absl::DataLossError("task.json or SHA256SUMS was altered");
  return absl::OkStatus();
}

absl::Status Bundle::ReadTask(const TarEntry& entry) {
  if (entry.size_bytes > kTaskJsonBytesMax) {
    return absl::ResourceExhaustedError(
        absl::StrCat("task.json has ", entry.size_bytes, " bytes, more than ", kTaskJsonBytesMax));
  }
  const absl::StatusOr<std::string> json = read_(entry.offset_bytes, entry.size_bytes);
  if (!json.ok()) return json.status();
  google::protobuf::util::JsonParseOptions options;
  options.ignore_unknown_fields = true;
  const auto parsed = google::protobuf::util::JsonStringToMessage(*json, &task_, options);
  if (!parsed.ok()) {
    return absl::InvalidArgumentError(absl::StrCat("task.json: ", parsed.ToString()));
  }
  if (task_.format() != kBundleFormat) {
    return absl::UnimplementedError(
        absl::StrCat("it has format ", task_.format(), ", this version of sheaf reads format ",
                     kBundleFormat, " (it was written by sheaf ", task_.version(), ")"));
  }
  absl::StatusOr<worker::Lease> lease = LeaseOf(task_);
  if (!lease.ok()) return Annotate(lease.status(), kTaskName);
  lease_ = *std::move(lease);
  const std::string digest =
      FrameDigest(lease_.scene.sha256_hex, lease_.settings, task_.numeric_profile());
  if (digest != lease_.frame_digest) {
    return absl::InvalidArgumentError(
        "task.json: scene, settings and numeric profile do not give its frame digest");
  }
  return absl::OkStatus();
}

absl::StatusOr<TarEntry> Bundle::Find(const BlobDigest& digest, const std::string& what) const {
  const auto found = files_.find(digest.sha256_hex);
  if (found == files_.end() || found->second.size_bytes != digest.size_bytes) {
    return absl::DataLossError(absl::StrCat(what, " (", digest.sha256_hex, ") is missing in it"));
  }
  return found->second;
}

absl::Status Bundle::ReadManifest() {
  const absl::StatusOr<TarEntry> entry = Find(lease_.scene, "the list of the scene's files");
  if (!entry.ok()) return entry.status();
  if (entry->size_bytes > kManifestBytesMax) {
    return absl::ResourceExhaustedError("its list of the scene's files is too large");
  }
  const absl::StatusOr<std::string> bytes = read_(entry->offset_bytes, entry->size_bytes);
  if (!bytes.ok()) return bytes.status();
  absl::StatusOr<Manifest> manifest = DecodeManifest(*bytes);
  if (!manifest.ok()) return manifest.status();
  manifest_ = *std::move(manifest);
  for (const ManifestFile& file : manifest_.files) {
    const absl::Status found = Find(file.digest, "a file of the scene").status();
    if (!found.ok()) return found;
  }
  if (lease_.field.sha256_hex.empty()) return absl::OkStatus();
  return Find(lease_.field, "the guiding field").status();
}

ContentCache::Fetch Bundle::Fetcher() const {
  return [this](const BlobDigest& digest, uint64_t offset_bytes,
                const ContentCache::Append& append) -> absl::Status {
    const absl::StatusOr<TarEntry> entry = Find(digest, "a file of the scene");
    if (!entry.ok()) return entry.status();
    for (uint64_t at = offset_bytes; at < entry->size_bytes; at += kBlobChunkBytesMax) {
      const absl::StatusOr<std::string> bytes =
          read_(entry->offset_bytes + at, std::min(kBlobChunkBytesMax, entry->size_bytes - at));
      if (!bytes.ok()) return bytes.status();
      if (absl::Status status = append(*bytes); !status.ok()) return status;
    }
    return absl::OkStatus();
  };
}

absl::StatusOr<std::string> Bundle::ReadField() const {
  if (lease_.field.sha256_hex.empty()) return std::string();
  const absl::StatusOr<TarEntry> entry = Find(lease_.field, "the guiding field");
  if (!entry.ok()) return entry.status();
  return read_(entry->offset_bytes, entry->size_bytes);
}

}  // namespace sheaf::cli
