// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FolderObjects: an ObjectStore whose objects are files, each at its key below one directory.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "common/base/file.h"
#include "common/objects/object_store.h"

namespace sheaf {

class FolderObjects : public ObjectStore {
 public:
  // Creates the directory if it is missing. is_durable: Sync waits for the disk; otherwise objects
  // survive kill -9, but not a loss of power. Errors: those of files.
  static absl::StatusOr<std::unique_ptr<FolderObjects>> Open(const std::string& directory,
                                                             bool is_durable);

  std::string Name() const override { return directory_; }
  absl::Status Put(const std::string& key, std::string_view bytes, PutMode mode) override;
  absl::Status PutFile(const std::string& key, const std::string& path) override;
  absl::Status Sync() override;
  absl::StatusOr<std::string> Get(const std::string& key, const FileDigest& digest) override;
  absl::StatusOr<std::string> GetRange(const std::string& key, uint64_t offset_bytes,
                                       uint64_t size_bytes_max) override;
  absl::StatusOr<uint64_t> Head(const std::string& key) override;
  absl::Status List(const std::string& folder,
                    const std::function<void(const StoredObject&)>& visit) override;
  absl::StatusOr<std::vector<std::string>> ListFolders(const std::string& folder) override;
  absl::Status Remove(const std::string& key) override;
  // Folders above that are empty now go, too.
  absl::Status RemoveFolder(const std::string& folder) override;
  std::optional<PutTicket> TicketToPut(const std::string& key, const FileDigest& digest) override;
  std::optional<ObjectCounts> Counts() const override { return std::nullopt; }

 private:
  FolderObjects(std::string directory, std::unique_ptr<FileSystemSync> file_system)
      : directory_(std::move(directory)), file_system_(std::move(file_system)) {}
  std::string PathOf(const std::string& key) const { return directory_ + "/" + key; }

  const std::string directory_;
  const std::unique_ptr<FileSystemSync> file_system_;  // Null where power loss is not survived.
};

}  // namespace sheaf
