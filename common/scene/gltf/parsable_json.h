// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The JSON of a file, as the parser takes it.
#pragma once

#include <string>
#include <string_view>

namespace sheaf::gltf {

// Where the accessor of a Draco primitive's indices stands in its extension.
inline constexpr char kDracoIndices[] = "sheafIndices";

// The JSON text with three changes; the same text if neither applies, or if it is not JSON.
// Fallback buffers of meshopt compression get one byte of their own: they mostly have none,
// which the parser refuses, and no view that is read refers to them. Some tools do not mark them.
// Draco primitives keep the accessor of their indices in the extension: the parser refuses one
// without a buffer view in the primitive. Images in a buffer view lose the file name that some
// exporters give them too, which the parser refuses.
std::string ParsableJson(std::string_view json);

// Whether the JSON text is that of glTF 1.0, which has objects in place of the arrays of 2.0.
bool IsFirstVersion(std::string_view json);

}  // namespace sheaf::gltf
