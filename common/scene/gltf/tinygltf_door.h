// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// tinygltf without its file access and without its image decoders: files come from FileSource, and
// images stay as they are. Classes of the header depend on these settings, so it is included here
// alone.
#pragma once

#define TINYGLTF_NO_FS
#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_EXTERNAL_IMAGE
#define TINYGLTF_NO_INCLUDE_JSON

#include <tiny_gltf.h>
