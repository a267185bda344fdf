// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/parsable_json.h"

#include <nlohmann/json.hpp>
#include <set>

namespace sheaf::gltf {
namespace {

using Json = nlohmann::json;

Json* Find(Json* object, const char* key) {
  if (object == nullptr || !object->is_object()) return nullptr;
  const auto found = object->find(key);
  return found == object->end() ? nullptr : &*found;
}

// The elements of an array; none of anything else.
Json* Array(Json* object, const char* key) {
  Json* found = Find(object, key);
  return found != nullptr && found->is_array() ? found : nullptr;
}

Json* MeshoptOf(Json* item) {
  Json* extensions = Find(item, "extensions");
  Json* found = Find(extensions, "EXT_meshopt_compression");
  return found != nullptr ? found : Find(extensions, "KHR_meshopt_compression");
}

// Buffers whose bytes are read: those of views without compression, and those that hold what is
// compressed.
std::set<size_t> ReadBuffers(Json* json) {
  std::set<size_t> numbers;
  Json* views = Array(json, "bufferViews");
  if (views == nullptr) return numbers;
  for (Json& view : *views) {
    Json* meshopt = MeshoptOf(&view);
    const Json* number = Find(meshopt == nullptr ? &view : meshopt, "buffer");
    if (number != nullptr && number->is_number_unsigned()) numbers.insert(number->get<size_t>());
  }
  return numbers;
}

// Whether a buffer is only what compressed views would be without compression: by its own word, or
// because it has no bytes and none are read. The first may have the bytes of a GLB file.
bool IsFallback(Json* buffer, size_t index, const std::set<size_t>& read) {
  const Json* fallback = Find(MeshoptOf(buffer), "fallback");
  if (fallback != nullptr && fallback->is_boolean() && fallback->get<bool>()) return true;
  return index > 0 && Find(buffer, "uri") == nullptr && !read.contains(index);
}

bool FillFallbacks(Json* json) {
  Json* buffers = Array(json, "buffers");
  if (buffers == nullptr) return false;
  const std::set<size_t> read = ReadBuffers(json);
  bool is_changed = false;
  for (size_t b = 0; b < buffers->size(); ++b) {
    Json& buffer = (*buffers)[b];
    if (!buffer.is_object() || !IsFallback(&buffer, b, read)) continue;
    buffer["byteLength"] = 1;
    buffer["uri"] = "data:application/octet-stream;base64,AA==";
    is_changed = true;
  }
  return is_changed;
}

bool MoveIndices(Json* primitive) {
  Json* draco = Find(Find(primitive, "extensions"), "KHR_draco_mesh_compression");
  Json* indices = Find(primitive, "indices");
  if (draco == nullptr || !draco->is_object() || indices == nullptr) return false;
  (*draco)[kDracoIndices] = *indices;
  primitive->erase("indices");
  return true;
}

bool Change(Json* json) {
  bool is_changed = FillFallbacks(json);
  if (Json* meshes = Array(json, "meshes")) {
    for (Json& mesh : *meshes) {
      Json* primitives = Array(&mesh, "primitives");
      if (primitives == nullptr) continue;
      for (Json& primitive : *primitives) is_changed |= MoveIndices(&primitive);
    }
  }
  return is_changed;
}

// Old exporters give images within the file a name too.
bool DropNamesOfEmbedded(Json* json) {
  Json* images = Array(json, "images");
  if (images == nullptr) return false;
  bool is_changed = false;
  for (Json& image : *images) {
    if (Find(&image, "bufferView") == nullptr || Find(&image, "uri") == nullptr) continue;
    image.erase("uri");
    is_changed = true;
  }
  return is_changed;
}

}  // namespace

std::string ParsableJson(std::string_view text) {
  std::string same(text);
  const auto has = [&](std::string_view part) { return text.find(part) != std::string_view::npos; };
  const bool is_compressed = has("_meshopt_compression\"") || has("\"KHR_draco_mesh_compression\"");
  const bool has_images = has("\"images\"") && has("\"mimeType\"") && has("\"uri\"");
  if (!is_compressed && !has_images) return same;
  Json json = Json::parse(text, nullptr, false);
  bool is_changed = is_compressed && Change(&json);
  is_changed |= DropNamesOfEmbedded(&json);
  return is_changed ? json.dump(-1, ' ', false, Json::error_handler_t::replace) : same;
}

bool IsFirstVersion(std::string_view text) {
  Json json = Json::parse(text, nullptr, false);
  for (const char* list : {"meshes", "nodes", "materials", "techniques"}) {
    const Json* found = Find(&json, list);
    if (found != nullptr && found->is_object()) return true;
  }
  return false;
}

}  // namespace sheaf::gltf
