// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/input_check.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <system_error>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/base/log.h"
#include "common/base/printable.h"
#include "common/image/image_io.h"
#include "common/scene/named_as_in_scene.h"
#include "common/volume/grid_names.h"

namespace sheaf::cli {
namespace {

struct NamedFile {
  SourceLocation location;
  std::string use;   // "texture "wood"".
  std::string file;  // Canonical name; empty: no file.
  enum class Kind { kTextureFile, kLightFile, kVolumeFile } kind = Kind::kTextureFile;
  std::string grid = {};  // The grid of a volume file.
};

std::string FileOf(const LightDescription& light) {
  if (const auto* infinite = std::get_if<InfiniteLight>(&light.light)) return infinite->file;
  if (const auto* projection = std::get_if<ProjectionLight>(&light.light)) return projection->file;
  const auto* goniometric = std::get_if<GoniometricLight>(&light.light);
  // A table of candelas was read together with the scene.
  return goniometric != nullptr && goniometric->table.candelas.empty() ? goniometric->file : "";
}

std::vector<NamedFile> FilesNamed(const SceneDescription& scene) {
  std::vector<NamedFile> files;
  for (const TextureDescription& texture : scene.textures) {
    const auto* image = std::get_if<ImageTexture>(&texture.texture);
    if (image == nullptr) continue;
    files.push_back(
        {texture.location, absl::StrCat("texture \"", texture.name, "\""), image->file});
  }
  for (const AreaLightDescription& light : scene.area_lights) {
    files.push_back({light.location, "area light", light.file, NamedFile::Kind::kLightFile});
  }
  for (const LightDescription& light : scene.lights) {
    files.push_back({light.location, "light", FileOf(light), NamedFile::Kind::kLightFile});
  }
  files.push_back({scene.camera.location, "aperture", scene.camera.lens.aperture_file,
                   NamedFile::Kind::kLightFile});
  for (const MediumDescription& medium : scene.media) {
    const auto* volume = std::get_if<VolumeFileMedium>(&medium.kind);
    if (volume == nullptr) continue;
    const NamedFile file{medium.location, absl::StrCat("medium \"", medium.name, "\""),
                         volume->file, NamedFile::Kind::kVolumeFile, volume->density_grid};
    files.push_back(file);
    if (!volume->temperature_grid || !medium.emits) continue;
    files.push_back(file);
    files.back().grid = *volume->temperature_grid;
  }
  return files;
}

// Says which grid is read where the file gives one name to several.
void NoteSharedName(const std::string& where, const NamedFile& named,
                    const std::vector<VolumeFileEntry>& entries) {
  const std::string second = volume::NumberedName(named.grid, 1);
  if (std::ranges::none_of(entries, [&](const auto& entry) { return entry.name == second; })) {
    return;
  }
  LogWarning(absl::StrCat(where, ": ", named.file, ": several grids are named \"", named.grid,
                          "\"; the first is read, and \"", second, "\" names the second"));
}

// Reads the grid only if that fails, or if the file is small.
absl::Status CheckVolume(const std::string& where, const NamedFile& named, const std::string& path,
                         VolumeReader* volumes) {
  const absl::StatusOr<std::vector<VolumeFileEntry>> entries = volumes->List(named.file, path);
  if (!entries.ok()) return entries.status();
  NoteSharedName(where, named, *entries);
  const auto entry = std::find_if(entries->begin(), entries->end(),
                                  [&](const VolumeFileEntry& e) { return e.name == named.grid; });
  std::error_code error;
  const uint64_t bytes = std::filesystem::file_size(path, error);
  const bool is_small = !error && bytes <= kWholeVolumeBytesMax;
  if (entry != entries->end() && entry->can_be_read && !is_small) return absl::OkStatus();
  return volumes->Read(named.file, path, named.grid).status();
}

absl::Status ReadAsFarAsNeeded(const std::string& where, const NamedFile& named,
                               const std::string& path, VolumeReader* volumes) {
  if (named.kind == NamedFile::Kind::kVolumeFile) {
    VolumeReader reader;
    return CheckVolume(where, named, path, volumes != nullptr ? volumes : &reader);
  }
  const bool is_light = named.kind == NamedFile::Kind::kLightFile;
  const absl::Status status =
      CheckImage(path, {.memory_bytes_max = std::numeric_limits<uint64_t>::max(),
                        .side_max = is_light ? kLightImageSideMax : kImageSideMax,
                        .whole_pixels_max = is_light ? 0 : kWholePixelsMax});
  return NamedAsInScene(status, path, named.file);
}

}  // namespace

absl::Status InputChecks::Once(const Use& use, const std::function<absl::Status()>& read) {
  {
    const MutexLock lock(&mutex_);
    if (const auto found = known_.find(use); found != known_.end()) return found->second;
  }
  absl::Status status = read();
  const MutexLock lock(&mutex_);
  return known_.emplace(use, std::move(status)).first->second;
}

absl::Status InputChecks::Check(const SceneDescription& scene, FileSource& files) {
  std::vector<std::string> errors;
  for (const NamedFile& named : FilesNamed(scene)) {
    if (named.file.empty()) continue;
    const absl::StatusOr<std::string> path = files.LocalPath(named.file);
    if (!path.ok()) return path.status();
    const bool is_light = named.kind == NamedFile::Kind::kLightFile;
    const std::string where =
        Printable(absl::StrCat(FormatLocation(scene, named.location), ": ", named.use));
    const absl::Status status = Once({*path, named.grid, is_light}, [&] {
      return ReadAsFarAsNeeded(where, named, *path, volumes_);
    });
    // Without its library (kFailedPrecondition) no image can be read; this is not an error of the
    // file.
    if (status.ok() || absl::IsFailedPrecondition(status)) continue;
    errors.push_back(absl::StrCat(where, ": ", Printable(std::string(status.message())),
                                  "; replace the file or remove it"));
  }
  return errors.empty() ? absl::OkStatus()
                        : absl::InvalidArgumentError(absl::StrJoin(errors, "\n"));
}

}  // namespace sheaf::cli
