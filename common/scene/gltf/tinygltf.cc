// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The implementation of tinygltf, which its header holds.
#define TINYGLTF_IMPLEMENTATION
#include <nlohmann/json.hpp>

#include <fstream>  // The header uses it without TINYGLTF_NO_FS alone.

#include "common/scene/gltf/tinygltf_door.h"
