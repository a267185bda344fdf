// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/vdb_file.h"

#include <utility>

#include "common/volume/vdb_library.h"
#include "common/volume/vdb_process.h"

namespace sheaf::volume {
namespace {

class VdbFileHere : public VdbFile {
 public:
  VdbFileHere(const VdbLibrary* library, std::string file_name, const FileBytes& file,
              const VolumeLimits& limits)
      : library_(library), file_name_(std::move(file_name)), file_(file), limits_(limits) {}

  absl::StatusOr<std::vector<VolumeFileEntry>> List() override {
    return library_->list(file_name_, file_.descriptor(), limits_);
  }
  absl::StatusOr<VolumeBytes> Read(size_t index) override {
    return library_->read(file_name_, file_.descriptor(), index, limits_);
  }
  absl::StatusOr<VolumeSurface> Surface(size_t index, float isovalue) override {
    return library_->surface(file_name_, file_.descriptor(), index, isovalue, limits_);
  }

 private:
  const VdbLibrary* const library_;
  const std::string file_name_;
  const FileBytes& file_;
  const VolumeLimits limits_;
};

}  // namespace

bool BeginsAsVdb(uint64_t first_eight_bytes) { return first_eight_bytes == 0x56444220; }

absl::StatusOr<std::unique_ptr<VdbFile>> VdbFile::Open(const std::string& file_name,
                                                       const FileBytes& file,
                                                       const VolumeLimits& limits) {
  if (!vdb_is_read_in_this_process) return OpenVdbInProcess(file_name, file, limits);
  const auto library = LoadVdbLibrary();
  if (!library.ok()) return library.status();
  return std::make_unique<VdbFileHere>(*library, file_name, file, limits);
}

}  // namespace sheaf::volume
