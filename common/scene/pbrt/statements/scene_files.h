// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneFiles: the files that the statements of a scene name. A small scene file may name one large
// file in each of its lines: what the reader needs of a file is read once, and what is read or
// copied again is bounded.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/scene/file_source.h"
#include "common/scene/formats/measured_file.h"
#include "common/scene/scene_description.h"

namespace sheaf {

class SceneFiles {
 public:
  // files must outlive this.
  SceneFiles(FileSource* files, uint64_t repeated_bytes_max)
      : files_(files), repeated_bytes_max_(repeated_bytes_max) {}

  // As FileSource::LocalPath, for files that only the renderer reads.
  absl::StatusOr<std::string> LocalPath(const std::string& canonical_name) {
    return files_->LocalPath(canonical_name);
  }
  // The same for a file that the caller then reads: its bytes count from the second time on.
  // least_bytes: what a reading counts at least, where it costs more than the bytes do. Errors:
  // also kResourceExhausted beyond repeated_bytes_max.
  absl::StatusOr<std::string> PathToRead(const std::string& canonical_name,
                                         uint64_t least_bytes = 0);

  // The contents of files of each kind; the pointers are valid as long as this is. A caller copies
  // what it gets, which counts as if it were read again. Errors: as PathToRead, and of the file.
  absl::StatusOr<const std::vector<float>*> SpectrumNumbers(const std::string& canonical_name);
  absl::StatusOr<const CandelaTable*> Candelas(const std::string& canonical_name);
  absl::StatusOr<const MeasuredShape*> MeasuredShapeOf(const std::string& canonical_name);

 private:
  // The content of a file by its name: known, or read by read(path), and copied by each caller.
  template <typename T, typename Read, typename Bytes>
  absl::StatusOr<const T*> Get(std::map<std::string, T>* known, const std::string& canonical_name,
                               const Read& read, const Bytes& copied_bytes);
  absl::Status ChargeRepeated(uint64_t bytes);

  FileSource* files_;
  const uint64_t repeated_bytes_max_;
  uint64_t repeated_bytes_ = 0;
  std::set<std::string> read_;
  std::map<std::string, std::vector<float>> spectra_;
  std::map<std::string, CandelaTable> candelas_;
  std::map<std::string, MeasuredShape> measured_;
};

}  // namespace sheaf
