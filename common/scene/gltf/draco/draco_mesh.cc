// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/draco/draco_mesh.h"

#include <draco/compression/config/decoder_options.h>
#include <draco/compression/mesh/mesh_edgebreaker_decoder.h>
#include <draco/compression/mesh/mesh_sequential_decoder.h>
#include <draco/core/decoder_buffer.h>
#include <draco/core/varint_decoding.h>
#include <draco/mesh/mesh.h>

#include <cstring>
#include <exception>
#include <type_traits>
#include <utility>

#include "absl/strings/str_cat.h"

namespace sheaf::gltf {
namespace {

// The decoder predicts values in integers, and keeps one for each component of an attribute.
constexpr uint64_t kPortableBytes = sizeof(int32_t);

// Types of components (glTF 2.0 specification, sec. 3.6.2.2).
enum ComponentType {
  kByte = 5120,
  kUnsignedByte = 5121,
  kShort = 5122,
  kUnsignedShort = 5123,
  kUnsignedInt = 5125,
  kFloat = 5126
};

absl::Status Invalid(const std::string& what) { return absl::InvalidArgumentError(what); }

// A decoder of Draco that stops before it takes more memory than the limits allow.
template <typename Decoder>
class LimitedDecoder : public Decoder {
 public:
  explicit LimitedDecoder(const DracoLimits& limits) : limits_(limits) {}
  const absl::Status& failure() const { return failure_; }

 protected:
  bool InitializeDecoder() override { return Decoder::InitializeDecoder() && CheckCounts(); }
  bool DecodeAllAttributes() override {
    return CheckAttributes() && Decoder::DecodeAllAttributes();
  }

 private:
  bool Fail(absl::Status status) {
    failure_ = std::move(status);
    return false;
  }
  bool Charge(uint64_t bytes) {
    return limits_.charge(bytes) ||
           Fail(absl::ResourceExhaustedError("needs more memory than the limit"));
  }

  // The counts stand first in the connectivity, which is decoded next.
  bool CheckCounts() {
    if (this->bitstream_version() != draco::kDracoMeshBitstreamVersion) {
      return Fail(Invalid("is not of Draco's version 2.2, which glTF prescribes"));
    }
    draco::DecoderBuffer ahead = *this->buffer();
    uint32_t first = 0, second = 0;
    if (!draco::DecodeVarint(&first, &ahead) || !draco::DecodeVarint(&second, &ahead)) {
      return Fail(Invalid("is truncated"));
    }
    constexpr bool kIsEdgebreaker = std::is_same_v<Decoder, draco::MeshEdgebreakerDecoder>;
    const uint64_t vertices = kIsEdgebreaker ? first : second;
    const uint64_t triangles = kIsEdgebreaker ? second : first;
    if (triangles > limits_.triangles_max) {
      return Fail(Invalid(absl::StrCat("has ", triangles, " triangles, but its accessors only ",
                                       limits_.triangles_max)));
    }
    if (vertices > 3 * triangles) {
      return Fail(
          Invalid(absl::StrCat("has ", vertices, " vertices for ", triangles, " triangles")));
    }
    // Seams of attributes split vertices, at most into one for each corner.
    return Charge(triangles * (kDracoBytesPerTriangle + 3 * sizeof(uint32_t)) +
                  vertices * kDracoBytesPerVertex);
  }

  // All attributes are known, and no value has been decoded.
  bool CheckAttributes() {
    const draco::PointCloud& cloud = *this->point_cloud();
    uint64_t bytes_per_vertex = kDracoBytesPerVertex;
    for (int32_t i = 0; i < cloud.num_attributes(); ++i) {
      const draco::PointAttribute& attribute = *cloud.attribute(i);
      bytes_per_vertex += static_cast<uint64_t>(attribute.byte_stride()) +
                          attribute.num_components() * kPortableBytes + sizeof(uint32_t);
    }
    return Charge(uint64_t{cloud.num_points()} * bytes_per_vertex);
  }

  const DracoLimits& limits_;
  absl::Status failure_;
};

template <typename Decoder>
absl::Status DecodeInto(std::string_view bytes, const DracoLimits& limits, draco::Mesh* mesh) {
  draco::DecoderBuffer buffer;
  buffer.Init(bytes.data(), bytes.size());
  LimitedDecoder<Decoder> decoder(limits);
  const draco::DecoderOptions options;
  const draco::Status status = decoder.Decode(options, &buffer, mesh);
  if (!decoder.failure().ok()) return decoder.failure();
  if (!status.ok()) return Invalid(absl::StrCat("is damaged: ", status.error_msg_string()));
  return absl::OkStatus();
}

absl::Status DecodeAny(std::string_view bytes, const DracoLimits& limits, draco::Mesh* mesh) {
  draco::DecoderBuffer buffer;
  buffer.Init(bytes.data(), bytes.size());
  draco::DracoHeader header;
  if (!draco::PointCloudDecoder::DecodeHeader(&buffer, &header).ok()) {
    return Invalid("does not begin as Draco data");
  }
  if (header.encoder_type != draco::TRIANGULAR_MESH) return Invalid("is not a mesh");
  switch (header.encoder_method) {
    case draco::MESH_SEQUENTIAL_ENCODING:
      return DecodeInto<draco::MeshSequentialDecoder>(bytes, limits, mesh);
    case draco::MESH_EDGEBREAKER_ENCODING:
      return DecodeInto<draco::MeshEdgebreakerDecoder>(bytes, limits, mesh);
    default:
      return Invalid(absl::StrCat("has the unknown method ", int{header.encoder_method}));
  }
}

template <typename T>
bool CopyValues(const draco::PointAttribute& attribute, uint32_t vertices, size_t components,
                unsigned char* out) {
  std::vector<T> value(components);
  for (uint32_t v = 0; v < vertices; ++v, out += components * sizeof(T)) {
    const draco::AttributeValueIndex index = attribute.mapped_index(draco::PointIndex(v));
    if (index.value() >= attribute.size() ||
        !attribute.ConvertValue(index, static_cast<int8_t>(components), value.data())) {
      return false;
    }
    std::memcpy(out, value.data(), components * sizeof(T));
  }
  return true;
}

absl::StatusOr<std::vector<unsigned char>> ValuesOf(const draco::Mesh& mesh,
                                                    const DracoAttribute& wanted) {
  const draco::PointAttribute* attribute = mesh.GetAttributeByUniqueId(wanted.id);
  if (attribute == nullptr) {
    return Invalid(absl::StrCat("has no attribute ", wanted.id, " (", wanted.name, ")"));
  }
  if (attribute->num_components() != wanted.components) {
    return Invalid(absl::StrCat("has ", int{attribute->num_components()}, " components of ",
                                wanted.name, ", its accessor ", wanted.components));
  }
  const uint32_t vertices = mesh.num_points();
  std::vector<unsigned char> bytes;
  const auto copy = [&](auto type) {
    bytes.resize(vertices * wanted.components * sizeof type);
    return CopyValues<decltype(type)>(*attribute, vertices, wanted.components, bytes.data());
  };
  bool ok = false;
  switch (wanted.component_type) {
    case kByte:
      ok = copy(int8_t{});
      break;
    case kUnsignedByte:
      ok = copy(uint8_t{});
      break;
    case kShort:
      ok = copy(int16_t{});
      break;
    case kUnsignedShort:
      ok = copy(uint16_t{});
      break;
    case kUnsignedInt:
      ok = copy(uint32_t{});
      break;
    case kFloat:
      ok = copy(float{});
      break;
    default:
      break;
  }
  if (!ok) {
    return Invalid(absl::StrCat("has values of ", wanted.name, " that its accessor cannot hold"));
  }
  return bytes;
}

absl::StatusOr<DracoMesh> MeshOf(const draco::Mesh& mesh,
                                 const std::vector<DracoAttribute>& wanted) {
  DracoMesh result;
  result.vertices = mesh.num_points();
  result.indices.reserve(size_t{3} * mesh.num_faces());
  for (uint32_t f = 0; f < mesh.num_faces(); ++f) {
    for (const draco::PointIndex& corner : mesh.face(draco::FaceIndex(f))) {
      if (corner.value() >= result.vertices) return Invalid("has corners without vertices");
      result.indices.push_back(corner.value());
    }
  }
  for (const DracoAttribute& attribute : wanted) {
    absl::StatusOr<std::vector<unsigned char>> bytes = ValuesOf(mesh, attribute);
    if (!bytes.ok()) return bytes.status();
    result.attributes.push_back(*std::move(bytes));
  }
  return result;
}

}  // namespace

absl::StatusOr<DracoMesh> DecodeDracoMesh(std::string_view bytes,
                                          const std::vector<DracoAttribute>& wanted,
                                          const DracoLimits& limits) {
  // Draco's containers may throw.
  try {
    draco::Mesh mesh;
    if (absl::Status status = DecodeAny(bytes, limits, &mesh); !status.ok()) return status;
    return MeshOf(mesh, wanted);
  } catch (const std::exception& exception) {
    return absl::ResourceExhaustedError(absl::StrCat("cannot be decoded: ", exception.what()));
  }
}

}  // namespace sheaf::gltf
