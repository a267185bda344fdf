// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/ply_reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/base/check.h"
#include "common/base/memory_room.h"
#include "common/scene/formats/number.h"
#include "common/scene/formats/ply_faces.h"
#include "common/scene/formats/ply_header.h"
#include "common/scene/formats/ply_slots.h"
#include "common/scene/vertex_rounding.h"

namespace sheaf {
namespace {

constexpr double kIndexMax = 4294967295.0;
// The corners of a face that is read at once.
constexpr uint64_t kFewCorners = 8;

bool IsIndex(double value) {
  return value >= 0 && value <= kIndexMax && value == std::floor(value);
}
absl::Status NoIndex(const char* element, uint64_t row, double value) {
  return absl::InvalidArgumentError(
      absl::StrCat(element, " ", row, ": ", value, " is not the index of a vertex"));
}

// Reads the elements of one file into a mesh.
class PlyMeshReader {
 public:
  PlyMeshReader(PlyBytes* bytes, const PlyHeader* header, const SceneReaderLimits& limits,
                PlyColors colors)
      : bytes_(bytes),
        header_(header),
        limits_(limits),
        reads_colors_(colors == PlyColors::kRead) {}

  absl::Status Read();
  // origin: as for ReadPly.
  absl::StatusOr<PlyMesh> Take(std::optional<Vec3d> origin);

 private:
  absl::Status ReadElement(const PlyElement& element);
  absl::Status CheckCount(const PlyElement& element) const;
  absl::Status ReadVertices(const PlyElement& element);
  absl::Status SkipRows(const PlyElement& element);
  // Read the properties of a vertex into the slots of `values`; the first, of floats alone, at
  // once.
  bool ReadFloats(const std::vector<Slot>& slots, double* values);
  bool ReadProperties(const std::vector<PlyProperty>& properties, const std::vector<Slot>& slots,
                      double* values);
  absl::Status AppendVertex(uint64_t number, const double* values, bool has_normal, bool has_uv);
  absl::Status ReadPolygon(uint64_t face, const PlyProperty& property);
  absl::Status ReadStrip(uint64_t row, const PlyProperty& property);
  absl::Status ReadIndices(const PlyElement& element,
                           absl::Status (PlyMeshReader::*read)(uint64_t, const PlyProperty&));
  void ListSkipped(const PlyElement& element, const std::vector<const PlyProperty*>& properties);
  void ListFile();
  absl::Status CheckMemory() const;
  absl::Status CheckIndices() const;
  bool ReadScalar(PlyType type, double* value);
  bool SkipProperty(const PlyProperty& property);
  bool ReadCount(const PlyProperty& property, uint64_t* count);
  absl::Status Stopped(std::string_view element, uint64_t number) const;

  PlyBytes* bytes_;
  const PlyHeader* header_;
  SceneReaderLimits limits_;
  bool reads_colors_;
  TriangleMesh mesh_;  // Without positions and indices.
  PlyFaces faces_;
  VertexRounding vertices_;
  std::string malformed_;  // Why ReadScalar failed, if the bytes are there but wrong.
  std::vector<PlySkipped> skipped_;
  bool has_vertices_ = false;  // The element was read.
};

absl::Status PlyMeshReader::Read() {
  for (const PlyElement& element : header_->elements) {
    if (absl::Status status = CheckCount(element); !status.ok()) return status;
  }
  for (const PlyElement& element : header_->elements) {
    if (absl::Status status = ReadElement(element); !status.ok()) return status;
  }
  if (vertices_.rounded().empty()) return absl::InvalidArgumentError("the file has no vertices");
  ListFile();
  return CheckIndices();
}

absl::Status PlyMeshReader::ReadElement(const PlyElement& element) {
  if (element.name == "vertex" && !has_vertices_) return ReadVertices(element);
  if (element.name == "face") return ReadIndices(element, &PlyMeshReader::ReadPolygon);
  if (element.name == "tristrips") return ReadIndices(element, &PlyMeshReader::ReadStrip);
  if (element.count > 0) {
    skipped_.push_back({element.line, element.count,
                        absl::StrCat("the element \"", element.name, "\" with "),
                        " rows is left out"});
  }
  return SkipRows(element);
}

// Lists properties that have no effect, in one entry.
void PlyMeshReader::ListSkipped(const PlyElement& element,
                                const std::vector<const PlyProperty*>& properties) {
  if (properties.empty() || element.count == 0) return;
  std::vector<std::string> names;
  for (const PlyProperty* property : properties) names.push_back(property->name);
  skipped_.push_back({properties.front()->line, element.count,
                      absl::StrCat("the ", names.size() == 1 ? "property " : "properties ",
                                   absl::StrJoin(names, ", "), " of "),
                      absl::StrCat(" rows of the element \"", element.name, "\" ",
                                   names.size() == 1 ? "has" : "have", " no effect")});
}

void PlyMeshReader::ListFile() {
  if (!header_->texture.empty()) {
    skipped_.push_back(
        {header_->texture_line, 0,
         absl::StrCat("the comment names the texture \"", header_->texture,
                      "\", which has no effect; give it to the material as a texture"),
         ""});
  }
  if (faces_.indices().empty()) {
    skipped_.push_back({0, vertices_.rounded().size(), "there are no faces, only points, and its ",
                        " vertices are not shown; export it with faces, or remove the shape",
                        true});
  }
  if (!bytes_->IsAtEnd()) {
    skipped_.push_back({0, 0,
                        "more follows the last element, and is not read; the counts in the header "
                        "may be wrong",
                        "", true});
  }
}

// Rejects a count for which the file is too small, before anything is allocated.
absl::Status PlyMeshReader::CheckCount(const PlyElement& element) const {
  uint64_t row_bytes_min = 0;
  for (const PlyProperty& property : element.properties) {
    // In ASCII, a digit and a blank.
    row_bytes_min += header_->format == PlyFormat::kAscii
                         ? 2
                         : PlySizeBytes(property.is_list ? property.count_type : property.type);
  }
  // The last blank of an ASCII file may be missing.
  const uint64_t bound = bytes_->size_bytes_bound() + 1;
  if (row_bytes_min > 0 && element.count > bound / row_bytes_min) {
    return absl::InvalidArgumentError(absl::StrCat("the header claims ", element.count,
                                                   " elements \"", element.name,
                                                   "\", more than the file's size can hold"));
  }
  if (element.name == "face" && element.count > limits_.triangles_max) {
    return absl::ResourceExhaustedError(absl::StrCat("the header claims ", element.count,
                                                     " faces; the limit triangles_max is ",
                                                     limits_.triangles_max));
  }
  return absl::OkStatus();
}

absl::Status PlyMeshReader::Stopped(std::string_view element, uint64_t number) const {
  const std::string place = absl::StrCat(std::string(element), " ", number);
  const std::string line =
      header_->format == PlyFormat::kAscii ? absl::StrCat("line ", bytes_->line(), ": ") : "";
  if (!bytes_->status().ok()) {
    return absl::Status(bytes_->status().code(),
                        absl::StrCat(line, place, ": ", bytes_->status().message()));
  }
  return absl::InvalidArgumentError(absl::StrCat(line, place, ": ", malformed_));
}

bool PlyMeshReader::ReadScalar(PlyType type, double* value) {
  if (header_->format == PlyFormat::kAscii) {
    std::string_view word;
    if (!bytes_->ReadWord(&word)) return false;
    if (ParseDouble(word, value)) return true;
    malformed_ = absl::StrCat("\"", std::string(word.substr(0, 40)), "\" is not a finite number");
    return false;
  }
  const unsigned char* bytes = bytes_->ReadBytes(PlySizeBytes(type));
  if (bytes == nullptr) return false;
  *value = PlyValueOf(type, bytes, header_->format == PlyFormat::kBigEndian);
  return true;
}

bool PlyMeshReader::ReadCount(const PlyProperty& property, uint64_t* count) {
  double value = 0;
  if (!ReadScalar(property.count_type, &value)) return false;
  if (IsIndex(value)) {
    *count = static_cast<uint64_t>(value);
    return true;
  }
  malformed_ = absl::StrCat("the list \"", property.name, "\" has the impossible length ", value);
  return false;
}

bool PlyMeshReader::SkipProperty(const PlyProperty& property) {
  uint64_t count = 1;
  if (property.is_list && !ReadCount(property, &count)) return false;
  double ignored = 0;
  for (uint64_t i = 0; i < count; ++i) {
    if (!ReadScalar(property.type, &ignored)) return false;
  }
  return true;
}

absl::Status PlyMeshReader::SkipRows(const PlyElement& element) {
  if (element.properties.empty()) return absl::OkStatus();
  for (uint64_t i = 0; i < element.count; ++i) {
    for (const PlyProperty& property : element.properties) {
      if (!SkipProperty(property)) return Stopped(element.name, i);
    }
  }
  return absl::OkStatus();
}

absl::Status PlyMeshReader::ReadVertices(const PlyElement& element) {
  has_vertices_ = true;
  std::array<bool, kSlotCount + 1> has{};
  const std::vector<Slot> slots = SlotsOf(element.properties, reads_colors_, &has);
  if (!has[kX] || !has[kY] || !has[kZ]) {
    return absl::InvalidArgumentError("the element \"vertex\" needs the properties x, y and z");
  }
  const bool has_normal = has[kNormalX] && has[kNormalY] && has[kNormalZ];
  const bool has_uv = has[kU] && has[kV];
  if (reads_colors_ && !(has[kRed] && has[kGreen] && has[kBlue])) {
    return absl::InvalidArgumentError(
        "the element \"vertex\" has no colors: it needs the properties red, green and blue, "
        "floats");
  }
  std::vector<const PlyProperty*> skipped;
  for (size_t i = 0; i < slots.size(); ++i) {
    const bool is_normal = slots[i] >= kNormalX && slots[i] <= kNormalZ;
    const bool is_uv = slots[i] == kU || slots[i] == kV;
    if (slots[i] == kSkipped || (is_normal && !has_normal) || (is_uv && !has_uv)) {
      skipped.push_back(&element.properties[i]);
    }
  }
  ListSkipped(element, skipped);
  // CheckCount has bounded the count by the file's size; beyond this limit, the vectors grow.
  constexpr uint64_t kReserveMax = uint64_t{1} << 20;
  vertices_.Reserve(std::min(element.count, kReserveMax));
  const bool is_floats =
      header_->format == PlyFormat::kLittleEndian && AreFloats(element.properties);
  for (uint64_t i = 0; i < element.count; ++i) {
    std::array<double, kSlotCount + 1> values{};
    values[kAlpha] = 1;
    const bool is_read = is_floats ? ReadFloats(slots, values.data())
                                   : ReadProperties(element.properties, slots, values.data());
    if (!is_read) return Stopped("vertex", i);
    if (absl::Status status = AppendVertex(i, values.data(), has_normal, has_uv); !status.ok()) {
      return status;
    }
  }
  return absl::OkStatus();
}

bool PlyMeshReader::ReadFloats(const std::vector<Slot>& slots, double* values) {
  const unsigned char* bytes = bytes_->ReadBytes(slots.size() * sizeof(float));
  if (bytes == nullptr) return false;
  for (size_t i = 0; i < slots.size(); ++i) {
    float value;
    std::memcpy(&value, bytes + i * sizeof value, sizeof value);
    values[slots[i]] = static_cast<double>(value);
  }
  return true;
}

bool PlyMeshReader::ReadProperties(const std::vector<PlyProperty>& properties,
                                   const std::vector<Slot>& slots, double* values) {
  for (size_t i = 0; i < slots.size(); ++i) {
    const PlyProperty& property = properties[i];
    const bool is_read =
        property.is_list ? SkipProperty(property) : ReadScalar(property.type, &values[slots[i]]);
    if (!is_read) return false;
  }
  return true;
}

absl::Status PlyMeshReader::AppendVertex(uint64_t number, const double* values, bool has_normal,
                                         bool has_uv) {
  std::array<float, kSlotCount> v;
  for (size_t i = 0; i < kSlotCount; ++i) {
    v[i] = static_cast<float>(values[i]);
    if (!std::isfinite(v[i])) {
      return absl::InvalidArgumentError(
          absl::StrCat("vertex ", number, ": ", kSlotNames[i], " is not a finite 32-bit float"));
    }
  }
  vertices_.Add({values[kX], values[kY], values[kZ]});
  if (has_normal) mesh_.normals.push_back({v[kNormalX], v[kNormalY], v[kNormalZ]});
  if (has_uv) mesh_.uvs.push_back({v[kU], v[kV]});
  if (reads_colors_) mesh_.colors.push_back({v[kRed], v[kGreen], v[kBlue], v[kAlpha]});
  return CheckMemory();
}

absl::Status PlyMeshReader::CheckMemory() const {
  const uint64_t bytes = vertices_.SizeBytes() + mesh_.normals.size() * sizeof(Vec3f) +
                         mesh_.uvs.size() * sizeof(Vec2f) +
                         mesh_.colors.size() * sizeof(VertexColor) + faces_.SizeBytes();
  if (bytes > limits_.memory_bytes_max) {
    return absl::ResourceExhaustedError(absl::StrCat("the mesh takes more than ",
                                                     FormatMemory(limits_.memory_bytes_max),
                                                     ", which is ", limits_.memory_limit));
  }
  if (faces_.indices().size() / 3 > limits_.triangles_max) {
    return absl::ResourceExhaustedError(absl::StrCat(
        "the mesh exceeds the limit of ", limits_.triangles_max, " triangles (triangles_max)"));
  }
  return absl::OkStatus();
}

// Reads the list of indices of each row by `read`.
absl::Status PlyMeshReader::ReadIndices(const PlyElement& element,
                                        absl::Status (PlyMeshReader::*read)(uint64_t,
                                                                            const PlyProperty&)) {
  const PlyProperty* indices = nullptr;
  std::vector<const PlyProperty*> skipped;
  for (const PlyProperty& property : element.properties) {
    const bool is_indices =
        property.is_list && (property.name == "vertex_indices" || property.name == "vertex_index");
    if (is_indices && indices == nullptr) {
      indices = &property;
    } else {
      skipped.push_back(&property);
    }
  }
  if (indices == nullptr) {
    return absl::InvalidArgumentError(
        absl::StrCat("the element \"", element.name, "\" needs the list vertex_indices"));
  }
  ListSkipped(element, skipped);
  for (uint64_t i = 0; i < element.count; ++i) {
    for (const PlyProperty& property : element.properties) {
      if (&property == indices) {
        if (absl::Status status = (this->*read)(i, property); !status.ok()) return status;
      } else if (!SkipProperty(property)) {
        return Stopped(element.name, i);
      }
    }
  }
  return absl::OkStatus();
}

absl::Status PlyMeshReader::ReadPolygon(uint64_t face, const PlyProperty& property) {
  uint64_t count = 0;
  if (!ReadCount(property, &count)) return Stopped("face", face);
  if (count < 3) {
    return absl::InvalidArgumentError(
        absl::StrCat("face ", face, " has ", count, " vertices; a face needs at least 3"));
  }
  faces_.BeginPolygon();
  if (header_->format == PlyFormat::kLittleEndian && count <= kFewCorners &&
      (property.type == PlyType::kInt32 || property.type == PlyType::kUint32)) {
    const unsigned char* bytes = bytes_->ReadBytes(count * sizeof(uint32_t));
    if (bytes == nullptr) return Stopped("face", face);
    for (uint64_t i = 0; i < count; ++i) {
      uint32_t index;
      std::memcpy(&index, bytes + i * sizeof index, sizeof index);
      const auto as_signed = static_cast<int32_t>(index);
      if (property.type == PlyType::kInt32 && as_signed < 0) {
        return NoIndex("face", face, as_signed);
      }
      faces_.AddToPolygon(index);
    }
    return CheckMemory();
  }
  for (uint64_t i = 0; i < count; ++i) {
    double value = 0;
    if (!ReadScalar(property.type, &value)) return Stopped("face", face);
    if (!IsIndex(value)) return NoIndex("face", face, value);
    faces_.AddToPolygon(static_cast<uint32_t>(value));
    if (absl::Status status = CheckMemory(); !status.ok()) return status;
  }
  return absl::OkStatus();
}

// -1, or as an unsigned number the largest, begins a new strip.
absl::Status PlyMeshReader::ReadStrip(uint64_t row, const PlyProperty& property) {
  uint64_t count = 0;
  if (!ReadCount(property, &count)) return Stopped("tristrips", row);
  faces_.BeginStrip();
  for (uint64_t i = 0; i < count; ++i) {
    double value = 0;
    if (!ReadScalar(property.type, &value)) return Stopped("tristrips", row);
    if (value == -1 || (property.type == PlyType::kUint32 && value == kIndexMax)) {
      faces_.BeginStrip();
      continue;
    }
    if (!IsIndex(value)) return NoIndex("tristrips", row, value);
    faces_.AddToStrip(static_cast<uint32_t>(value));
    if (absl::Status status = CheckMemory(); !status.ok()) return status;
  }
  return absl::OkStatus();
}

absl::StatusOr<PlyMesh> PlyMeshReader::Take(std::optional<Vec3d> origin) {
  PlyMesh result{std::move(mesh_), origin.value_or(Vec3d{}), {}, {}};
  result.mesh.positions =
      origin.has_value() ? vertices_.TakeAbout(*origin) : vertices_.Take(&result.origin);
  uint64_t crossing_count = 0;
  if (absl::Status status = faces_.Cut(result.mesh.positions, &crossing_count); !status.ok()) {
    return status;
  }
  if (crossing_count > 0) {
    skipped_.push_back({0, crossing_count, "",
                        " faces cross themselves or lie in no plane, and are cut as fans from "
                        "their first vertex; export the mesh as triangles"});
  }
  result.mesh.indices = faces_.TakeIndices();
  result.fans = faces_.TakeFans();
  result.skipped = std::move(skipped_);
  return result;
}

absl::Status PlyMeshReader::CheckIndices() const {
  const size_t count = vertices_.rounded().size();
  for (size_t i = 0; i < faces_.indices().size(); ++i) {
    if (faces_.indices()[i] < count) continue;
    return absl::InvalidArgumentError(absl::StrCat("triangle ", i / 3, " uses vertex ",
                                                   faces_.indices()[i], ", but there are only ",
                                                   count, " vertices"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<PlyMesh> ReadPly(const std::string& path, const SceneReaderLimits& limits,
                                std::optional<Vec3d> origin, PlyColors colors) {
  absl::StatusOr<std::unique_ptr<TextInput>> input = TextInput::Open(path, limits.file_bytes_max);
  if (!input.ok()) return input.status();
  PlyBytes bytes(std::move(*input));
  const absl::StatusOr<PlyHeader> header = ReadPlyHeader(bytes);
  if (!header.ok()) return header.status();
  PlyMeshReader reader(&bytes, &*header, limits, colors);
  if (absl::Status status = reader.Read(); !status.ok()) return status;
  return reader.Take(origin);
}

}  // namespace sheaf
