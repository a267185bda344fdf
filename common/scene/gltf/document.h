// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Loads a glTF file and its buffers. The bytes are untrusted: the parser sees only what has passed
// the checks here.
#pragma once

#include "common/scene/gltf/tinygltf_door.h"

#include <memory>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_reader_limits.h"

namespace sheaf::gltf {

inline constexpr uint64_t kJsonBytesMax = uint64_t{256} << 20;
inline constexpr int kJsonDepthMax = 64;  // Nested lists and objects; the parser is recursive.
inline constexpr size_t kItemsMax = 4'000'000;  // Nodes, meshes, accessors, and so on: of each.

// The canonical name of a file that the scene file names by a relative URI, with %20 and the like
// decoded. Errors: kInvalidArgument for a name that leads out of the scene file's folder, since the
// files that a scene names are uploaded and the scene may be foreign.
absl::StatusOr<std::string> NameOfUri(const std::string& main_file, std::string_view uri);

// Images are not loaded: those of data URIs are left in Image::image as they are in the file,
// others stay where bufferView and uri say. Errors: kInvalidArgument; kResourceExhausted beyond the
// limits; kNotFound for files. Messages begin with the file's name. warning: what the parser
// doubts, in one line; empty if nothing.
absl::StatusOr<std::unique_ptr<tinygltf::Model>> LoadDocument(const std::string& main_file,
                                                              FileSource& files,
                                                              const SceneReaderLimits& limits,
                                                              std::string* warning);

}  // namespace sheaf::gltf
