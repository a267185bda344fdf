// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/parsable_json.h"

#include <nlohmann/json.hpp>

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

bool FillFallback(Json* buffer) {
  const Json* fallback =
      Find(Find(Find(buffer, "extensions"), "EXT_meshopt_compression"), "fallback");
  if (fallback == nullptr || !fallback->is_boolean() || !fallback->get<bool>()) return false;
  (*buffer)["byteLength"] = 1;
  (*buffer)["uri"] = "data:application/octet-stream;base64,AA==";
  return true;
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
  bool is_changed = false;
  if (Json* buffers = Array(json, "buffers")) {
    for (Json& buffer : *buffers) is_changed |= FillFallback(&buffer);
  }
  if (Json* meshes = Array(json, "meshes")) {
    for (Json& mesh : *meshes) {
      Json* primitives = Array(&mesh, "primitives");
      if (primitives == nullptr) continue;
      for (Json& primitive : *primitives) is_changed |= MoveIndices(&primitive);
    }
  }
  return is_changed;
}

}  // namespace

std::string ParsableJson(std::string_view text) {
  std::string same(text);
  if (text.find("\"EXT_meshopt_compression\"") == std::string_view::npos &&
      text.find("\"KHR_draco_mesh_compression\"") == std::string_view::npos) {
    return same;
  }
  Json json = Json::parse(text, nullptr, false);
  return Change(&json) ? json.dump(-1, ' ', false, Json::error_handler_t::replace) : same;
}

}  // namespace sheaf::gltf
