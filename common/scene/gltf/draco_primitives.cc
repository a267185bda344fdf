// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/draco_primitives.h"

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/scene/gltf/draco/draco_mesh.h"
#include "common/scene/gltf/parsable_json.h"
#include "common/scene/gltf/values.h"

namespace sheaf::gltf {
namespace {

class DracoPrimitives {
 public:
  DracoPrimitives(tinygltf::Model* model, Accessors* accessors, Diagnostics* diagnostics)
      : model_(model), accessors_(accessors), diagnostics_(diagnostics) {}

  bool DecodeAll() {
    for (size_t m = 0; m < model_->meshes.size(); ++m) {
      tinygltf::Mesh& mesh = model_->meshes[m];
      for (size_t p = 0; p < mesh.primitives.size(); ++p) {
        const tinygltf::Value* extension = Find(mesh.primitives[p].extensions, kDraco);
        if (extension == nullptr) continue;
        what_ = absl::StrCat(Named("mesh", static_cast<int>(m), mesh.name), ", primitive ", p);
        if (!Decode(extension, &mesh.primitives[p])) return false;
      }
    }
    return true;
  }

 private:
  // Attributes of a Draco mesh with the accessors that say their types, and the indices' accessor.
  struct Request {
    int view = -1, indices = -1, mode = 0;
    std::vector<std::tuple<std::string, uint32_t, int>> attributes;  // Name, id, accessor.
    auto operator<=>(const Request&) const = default;
  };
  struct Result {
    std::map<std::string, int> attributes;
    int indices = -1;
  };

  bool Fail(const std::string& problem) {
    diagnostics_->Error(kFile, absl::StrCat(what_, ": the Draco mesh (", kDraco, ") ", problem,
                                            "; compress the file again, or export it without"));
    return false;
  }

  bool Decode(const tinygltf::Value* extension, tinygltf::Primitive* primitive) {
    Request request;
    if (!ReadRequest(extension, *primitive, &request)) return false;
    auto found = known_.find(request);
    if (found == known_.end()) {
      std::optional<Result> result = Read(request);
      if (!result) return false;
      found = known_.emplace(std::move(request), *std::move(result)).first;
    }
    for (const auto& [name, accessor] : found->second.attributes) {
      primitive->attributes[name] = accessor;
    }
    primitive->indices = found->second.indices;
    primitive->mode = TINYGLTF_MODE_TRIANGLES;
    return true;
  }

  bool ReadRequest(const tinygltf::Value* extension, const tinygltf::Primitive& primitive,
                   Request* request) {
    request->view = IndexOf(extension, "bufferView");
    request->indices = IndexOf(extension, kDracoIndices);
    request->mode = primitive.mode < 0 ? TINYGLTF_MODE_TRIANGLES : primitive.mode;
    if (request->mode != TINYGLTF_MODE_TRIANGLES && request->mode != TINYGLTF_MODE_TRIANGLE_STRIP) {
      return Fail("belongs to a primitive that is neither triangles nor a strip of them");
    }
    const tinygltf::Value* attributes = Member(extension, "attributes");
    if (attributes == nullptr || !attributes->IsObject()) return Fail("names no attributes");
    for (const std::string& name : attributes->Keys()) {
      const auto accessor = primitive.attributes.find(name);
      const int id = IndexOf(attributes, name);
      if (id < 0) return Fail(absl::StrCat("has no id of ", name));
      if (accessor == primitive.attributes.end() ||
          !HasIndex(model_->accessors, accessor->second)) {
        return Fail(absl::StrCat("has ", name, ", for which the primitive has no accessor"));
      }
      request->attributes.emplace_back(name, static_cast<uint32_t>(id), accessor->second);
    }
    return true;
  }

  // How many triangles the primitive's accessors say that there are at most.
  uint64_t TrianglesOf(const Request& request) const {
    uint64_t corners = 0;
    if (HasIndex(model_->accessors, request.indices)) {
      corners = model_->accessors[static_cast<size_t>(request.indices)].count;
    } else if (!request.attributes.empty()) {
      corners = model_->accessors[static_cast<size_t>(std::get<2>(request.attributes[0]))].count;
    }
    return request.mode == TINYGLTF_MODE_TRIANGLES ? corners / 3 : corners;
  }

  std::optional<std::string_view> BytesOf(int index) {
    if (!HasIndex(model_->bufferViews, index)) return std::nullopt;
    const tinygltf::BufferView& view = model_->bufferViews[static_cast<size_t>(index)];
    if (!HasIndex(model_->buffers, view.buffer)) return std::nullopt;
    const std::vector<unsigned char>& data = model_->buffers[static_cast<size_t>(view.buffer)].data;
    if (view.byteOffset > data.size() || view.byteLength > data.size() - view.byteOffset) {
      return std::nullopt;
    }
    return std::string_view(reinterpret_cast<const char*>(data.data()) + view.byteOffset,
                            view.byteLength);
  }

  std::optional<Result> Read(const Request& request) {
    const std::optional<std::string_view> bytes = BytesOf(request.view);
    if (!bytes) {
      Fail(absl::StrCat("is in buffer view ", request.view, ", which does not exist"));
      return std::nullopt;
    }
    std::vector<DracoAttribute> wanted;
    for (const auto& [name, id, accessor] : request.attributes) {
      const tinygltf::Accessor& type = model_->accessors[static_cast<size_t>(accessor)];
      const int components = tinygltf::GetNumComponentsInType(static_cast<uint32_t>(type.type));
      wanted.push_back(
          {name, id, type.componentType, static_cast<size_t>(std::max(components, 0))});
    }
    bool is_charged = true;  // Otherwise Charge has reported the limit.
    const DracoLimits limits{TrianglesOf(request),
                             [&](uint64_t more) { return is_charged = accessors_->Charge(more); }};
    absl::StatusOr<DracoMesh> mesh = DecodeDracoMesh(*bytes, wanted, limits);
    if (!mesh.ok()) {
      if (is_charged) Fail(std::string(mesh.status().message()));
      return std::nullopt;
    }
    return Add(request, *std::move(mesh));
  }

  Result Add(const Request& request, DracoMesh mesh) {
    Result result;
    for (size_t i = 0; i < request.attributes.size(); ++i) {
      const auto& [name, id, like] = request.attributes[i];
      tinygltf::Accessor accessor = model_->accessors[static_cast<size_t>(like)];
      accessor.count = mesh.vertices;
      result.attributes[name] = AddAccessor(std::move(accessor), std::move(mesh.attributes[i]));
    }
    tinygltf::Accessor accessor;
    accessor.componentType = TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
    accessor.type = TINYGLTF_TYPE_SCALAR;
    accessor.count = mesh.indices.size();
    const auto* first = reinterpret_cast<const unsigned char*>(mesh.indices.data());
    result.indices =
        AddAccessor(std::move(accessor), {first, first + mesh.indices.size() * sizeof(uint32_t)});
    return result;
  }

  int AddAccessor(tinygltf::Accessor accessor, std::vector<unsigned char> bytes) {
    tinygltf::BufferView view;
    view.buffer = static_cast<int>(model_->buffers.size());
    view.byteLength = bytes.size();
    accessor.bufferView = static_cast<int>(model_->bufferViews.size());
    accessor.byteOffset = 0;
    tinygltf::Buffer buffer;
    buffer.data = std::move(bytes);
    model_->buffers.push_back(std::move(buffer));
    model_->bufferViews.push_back(std::move(view));
    model_->accessors.push_back(std::move(accessor));
    return static_cast<int>(model_->accessors.size() - 1);
  }

  tinygltf::Model* model_;
  Accessors* accessors_;
  Diagnostics* diagnostics_;
  std::string what_;  // The primitive that is read.
  std::map<Request, Result> known_;
};

}  // namespace

bool DecodeDracoPrimitives(tinygltf::Model* model, Accessors* accessors, Diagnostics* diagnostics) {
  return DracoPrimitives(model, accessors, diagnostics).DecodeAll();
}

}  // namespace sheaf::gltf
