// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/scene_file_reader.h"

#include "common/base/file.h"
#include "common/base/status.h"
#include "common/scene/gltf/gltf_reader.h"
#include "common/scene/gltf/gltf_view.h"

namespace sheaf {
namespace {

constexpr uint64_t kViewBytesMax = uint64_t{64} << 10;

}  // namespace

absl::StatusOr<ReadSceneResult> ReadSceneByName(const std::string& main_file, FileSource& files,
                                                const SceneReaderLimits& limits) {
  if (!IsGltfName(main_file)) return ReadScene(main_file, files, limits);
  GltfView view;
  if (const absl::StatusOr<std::string> path = files.LocalPath(GltfViewFile(main_file));
      path.ok()) {
    const absl::StatusOr<std::string> text = ReadWholeFile(*path, kViewBytesMax);
    if (!text.ok()) return text.status();
    const absl::StatusOr<GltfView> decoded = DecodeGltfView(*text);
    if (!decoded.ok()) return Annotate(decoded.status(), main_file);
    view = *decoded;
  }
  return ReadGltf(main_file, files, view, limits);
}

}  // namespace sheaf
