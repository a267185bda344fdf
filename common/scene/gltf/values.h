// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Values of extensions, which tinygltf keeps as trees without types: numbers, colors, names. A
// value that is missing or of another type gives the default.
#pragma once

#include "common/scene/gltf/tinygltf_door.h"

#include <optional>
#include <string>
#include <vector>

#include "common/math/vec.h"
#include "common/scene/scene_description.h"

namespace sheaf::gltf {

// Errors and notes about the file as a whole: JSON has no lines that its values remember.
inline constexpr SourceLocation kFile{0, 0, 0};

// Null if there is none of this name, or if it is not an object.
const tinygltf::Value* Find(const tinygltf::ExtensionMap& extensions, const std::string& name);
const tinygltf::Value* Member(const tinygltf::Value* object, const std::string& key);

// Not finite numbers count as missing.
double NumberOf(const tinygltf::Value* object, const std::string& key, double fallback);
int IndexOf(const tinygltf::Value* object, const std::string& key);  // -1: none.
std::string TextOf(const tinygltf::Value* object, const std::string& key);
std::vector<double> NumbersOf(const tinygltf::Value* object, const std::string& key, size_t count,
                              std::vector<double> fallback);
Rgb ColorOf(const tinygltf::Value* object, const std::string& key, Rgb fallback);
// Three numbers of a list of any length; `fallback` if it has fewer than three numbers.
Rgb ColorOfNumbers(const std::vector<double>& numbers, Rgb fallback);
ColorSpec Color(Rgb rgb);

// "material 3 "gold"".
std::string Named(const char* kind, int index, const std::string& name);
template <typename List>
bool HasIndex(const List& list, int index) {
  return index >= 0 && static_cast<size_t>(index) < list.size();
}

}  // namespace sheaf::gltf
