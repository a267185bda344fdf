// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/meshopt_views.h"

#include <meshoptimizer.h>

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/scene/gltf/values.h"

namespace sheaf::gltf {
namespace {

// A compressed view, checked (EXT_meshopt_compression, "Specifying compressed views").
struct Source {
  const unsigned char* bytes = nullptr;
  size_t size = 0, count = 0, stride = 0;
  std::string mode, filter;
};

constexpr double kWholeMax = 9007199254740992;  // 2^53: beyond it doubles are no longer exact.

std::optional<uint64_t> WholeNumber(const tinygltf::Value* object, const std::string& key,
                                    double fallback) {
  const double number = NumberOf(object, key, fallback);
  if (!(number >= 0 && number <= kWholeMax)) return std::nullopt;
  return static_cast<uint64_t>(number);
}

// The reason why a stride, a count or a filter cannot be; empty if they can.
std::string WhyImpossible(const Source& source) {
  const size_t stride = source.stride, count = source.count;
  const bool is_short = stride == 2 || stride == 4;
  if (source.mode == "ATTRIBUTES") {
    if (stride == 0 || stride % 4 != 0 || stride > kMeshoptStrideMax) {
      return absl::StrCat("has a stride of ", stride,
                          " bytes; of attributes it is a multiple of 4 up to ", kMeshoptStrideMax);
    }
  } else if (source.mode == "TRIANGLES" || source.mode == "INDICES") {
    if (!is_short) return absl::StrCat("has indices of ", stride, " bytes, not of 2 or 4");
    if (source.mode == "TRIANGLES" && count % 3 != 0) {
      return absl::StrCat("has ", count, " indices, not three for each triangle");
    }
  } else {
    return absl::StrCat("has the unknown mode \"", source.mode, "\"");
  }
  const bool fits =
      source.filter == "NONE" ||
      (source.mode == "ATTRIBUTES" &&
       ((source.filter == "OCTAHEDRAL" && (stride == 4 || stride == 8)) ||
        (source.filter == "QUATERNION" && stride == 8) || source.filter == "EXPONENTIAL"));
  if (!fits) {
    return absl::StrCat("has the filter \"", source.filter, "\", which is unknown or does not fit ",
                        source.mode, " of ", stride, " bytes");
  }
  return "";
}

// Nothing, with the reason in problem, if the extension does not describe bytes of the file.
std::optional<Source> SourceOf(const tinygltf::Model& model, const tinygltf::Value* extension,
                               std::string* problem) {
  const int buffer = IndexOf(extension, "buffer");
  if (!HasIndex(model.buffers, buffer)) {
    *problem = absl::StrCat("refers to buffer ", buffer, ", which does not exist");
    return std::nullopt;
  }
  const std::vector<unsigned char>& data = model.buffers[static_cast<size_t>(buffer)].data;
  const std::optional<uint64_t> offset = WholeNumber(extension, "byteOffset", 0),
                                size = WholeNumber(extension, "byteLength", -1),
                                stride = WholeNumber(extension, "byteStride", -1),
                                count = WholeNumber(extension, "count", -1);
  if (!offset || !size || !stride || !count) {
    *problem = "lacks byteLength, byteStride or count, or has impossible ones";
    return std::nullopt;
  }
  if (*offset > data.size() || *size > data.size() - *offset) {
    *problem = absl::StrCat("ends after buffer ", buffer);
    return std::nullopt;
  }
  Source source{data.data() + *offset,      *size, *count, *stride, TextOf(extension, "mode"),
                TextOf(extension, "filter")};
  if (source.filter.empty()) source.filter = "NONE";
  *problem = WhyImpossible(source);
  // The low half of the first byte is the codec's version; the library reads the first.
  if (problem->empty() && source.mode == "ATTRIBUTES" && *size > 0 && (*source.bytes & 15) > 0) {
    *problem = "is of a later version of the codec than Sheaf reads";
  }
  if (problem->empty() && *count > kMeshoptExpansionMax * *size / *stride) {
    *problem = absl::StrCat("says that ", *size, " bytes hold ", *count, " elements of ", *stride,
                            " bytes, more than they can");
  }
  return problem->empty() ? std::optional(std::move(source)) : std::nullopt;
}

bool Decode(const Source& source, std::vector<unsigned char>* out) {
  out->resize(source.count * source.stride);
  if (source.count == 0) return true;
  if (source.mode == "TRIANGLES") {
    return meshopt_decodeIndexBuffer(out->data(), source.count, source.stride, source.bytes,
                                     source.size) == 0;
  }
  if (source.mode == "INDICES") {
    return meshopt_decodeIndexSequence(out->data(), source.count, source.stride, source.bytes,
                                       source.size) == 0;
  }
  if (meshopt_decodeVertexBuffer(out->data(), source.count, source.stride, source.bytes,
                                 source.size) != 0) {
    return false;
  }
  if (source.filter == "OCTAHEDRAL") {
    meshopt_decodeFilterOct(out->data(), source.count, source.stride);
  } else if (source.filter == "QUATERNION") {
    meshopt_decodeFilterQuat(out->data(), source.count, source.stride);
  } else if (source.filter == "EXPONENTIAL") {
    meshopt_decodeFilterExp(out->data(), source.count, source.stride);
  }
  return true;
}

}  // namespace

bool DecodeMeshoptViews(tinygltf::Model* model, Accessors* accessors, Diagnostics* diagnostics) {
  for (size_t v = 0; v < model->bufferViews.size(); ++v) {
    tinygltf::BufferView& view = model->bufferViews[v];
    const char* const name = Find(view.extensions, kMeshopt) != nullptr ? kMeshopt : kMeshoptKhr;
    const tinygltf::Value* extension = Find(view.extensions, name);
    if (extension == nullptr) continue;
    std::string problem;
    const std::optional<Source> source = SourceOf(*model, extension, &problem);
    if (source && !accessors->Charge(uint64_t{source->count} * source->stride)) return false;
    tinygltf::Buffer decoded;
    if (source && !Decode(*source, &decoded.data)) problem = "is damaged";
    if (!problem.empty()) {
      diagnostics->Error(kFile, absl::StrCat("buffer view ", v, " (", name, ") ", problem,
                                             "; compress the file again, or export it without"));
      return false;
    }
    view.buffer = static_cast<int>(model->buffers.size());
    view.byteOffset = 0;
    view.byteLength = decoded.data.size();
    model->buffers.push_back(std::move(decoded));
  }
  return true;
}

}  // namespace sheaf::gltf
