// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/tensor_file.h"

#include <bit>
#include <cstring>
#include <fstream>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"

namespace sheaf {
namespace {

static_assert(std::endian::native == std::endian::little,
              "values are read as they lie in the file");

constexpr char kMagic[12] = "tensor_file";

// 0 for an unknown code.
uint64_t BytesOfType(uint8_t type) {
  constexpr uint8_t kBytes[] = {0, 1, 1, 2, 2, 4, 4, 8, 8, 2, 4, 8};
  return type < std::size(kBytes) ? kBytes[type] : 0;
}

// The head of a file, number by number. The first error is sticky; after it every number is 0.
class HeadReader {
 public:
  HeadReader(std::string name, std::ifstream* file) : name_(std::move(name)), file_(*file) {}

  const absl::Status& status() const { return status_; }
  bool ok() const { return status_.ok(); }
  void Fail(const std::string& what) {
    if (!ok()) return;
    const std::string field =
        field_.empty() ? std::string() : absl::StrCat("field \"", field_, "\": ");
    status_ = absl::InvalidArgumentError(absl::StrCat(name_, ": ", field, what));
  }
  void set_field(std::string field) { field_ = std::move(field); }

  template <typename Number>
  Number Take(const char* what) {
    Number number{};
    Bytes(reinterpret_cast<char*>(&number), sizeof number, what);
    return ok() ? number : Number{};
  }
  std::string TakeString(size_t size, const char* what) {
    std::string text(size, '\0');
    Bytes(text.data(), size, what);
    return text;
  }

 private:
  void Bytes(char* to, size_t size, const char* what) {
    if (!ok()) return;
    file_.read(to, static_cast<std::streamsize>(size));
    if (file_.gcount() != static_cast<std::streamsize>(size)) {
      Fail(absl::StrCat("the file ends where ", what, " should be"));
    }
  }

  std::string name_;
  std::ifstream& file_;
  std::string field_;  // The one being read.
  absl::Status status_;
};

// Replaces unprintable characters for messages.
std::string Printable(std::string text) {
  for (char& c : text) {
    if (c < ' ' || c > '~') c = '?';
  }
  return text;
}

TensorField TakeField(HeadReader* head, uint64_t file_bytes) {
  TensorField field;
  head->set_field("");
  const auto name_bytes = head->Take<uint16_t>("the length of a field's name");
  if (name_bytes > kTensorNameBytesMax) {
    head->Fail(
        absl::StrCat("a field's name has ", name_bytes, " bytes, more than ", kTensorNameBytesMax));
  }
  if (!head->ok()) return field;
  field.name = head->TakeString(name_bytes, "a field's name");
  head->set_field(Printable(field.name));
  const auto rank = head->Take<uint16_t>("its number of dimensions");
  const auto type = head->Take<uint8_t>("its type");
  field.offset_bytes = head->Take<uint64_t>("its offset");
  if (rank > kTensorRankMax) {
    head->Fail(absl::StrCat("has ", rank, " dimensions, more than ", kTensorRankMax));
  }
  field.size_bytes = BytesOfType(type);
  if (field.size_bytes == 0) head->Fail(absl::StrCat("has the unknown type ", int{type}));
  field.type = static_cast<TensorType>(type);
  for (uint16_t i = 0; i < rank && head->ok(); ++i) {
    const auto size = head->Take<uint64_t>("its sizes");
    if (size == 0 || size > file_bytes || field.size_bytes > file_bytes / size) {
      head->Fail(absl::StrCat("cannot have size ", size, " in dimension ", i, " in a file of ",
                              file_bytes, " bytes"));
    }
    field.shape.push_back(size);
    field.size_bytes *= size;
  }
  if (field.offset_bytes > file_bytes || field.size_bytes > file_bytes - field.offset_bytes) {
    head->Fail(absl::StrCat("lies beyond the end of the file: ", field.size_bytes, " bytes at ",
                            field.offset_bytes, " of ", file_bytes));
  }
  return field;
}

}  // namespace

uint64_t TensorField::ValueCount() const {
  return size_bytes / BytesOfType(static_cast<uint8_t>(type));
}

absl::StatusOr<TensorFile> TensorFile::Open(const std::string& name, const std::string& path) {
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  const std::streamoff end = file ? static_cast<std::streamoff>(file.tellg()) : -1;
  if (end < 0) return absl::NotFoundError(absl::StrCat(name, ": cannot be opened"));
  const auto file_bytes = static_cast<uint64_t>(end);
  if (file_bytes > kTensorFileBytesMax) {
    return absl::ResourceExhaustedError(absl::StrCat(
        name, ": has ", file_bytes, " bytes; tensor files may have ", kTensorFileBytesMax));
  }
  file.seekg(0);
  HeadReader head(name, &file);
  const std::string magic = head.TakeString(sizeof kMagic, "\"tensor_file\"");
  if (head.ok() && std::memcmp(magic.data(), kMagic, sizeof kMagic) != 0) {
    head.Fail("does not begin with \"tensor_file\"; is it a .bsdf file?");
  }
  const auto major = head.Take<uint8_t>("its version"), minor = head.Take<uint8_t>("its version");
  if (major != 1 || minor != 0) {
    head.Fail(absl::StrCat("has version ", int{major}, ".", int{minor}, ", not 1.0"));
  }
  const auto count = head.Take<uint32_t>("the number of fields");
  if (count > kTensorFieldsMax) {
    head.Fail(absl::StrCat("has ", count, " fields, more than ", kTensorFieldsMax));
  }
  TensorFile tensor;
  tensor.name_ = name;
  tensor.path_ = path;
  uint64_t total_bytes = 0;
  for (uint32_t i = 0; i < count && head.ok(); ++i) {
    TensorField field = TakeField(&head, file_bytes);
    if (head.ok() && tensor.Find(field.name) != nullptr) head.Fail("is there twice");
    total_bytes += field.size_bytes;
    if (total_bytes > file_bytes) head.Fail("overlaps other fields: together they exceed the file");
    tensor.fields_.push_back(std::move(field));
  }
  if (!head.ok()) return head.status();
  return tensor;
}

const TensorField* TensorFile::Find(const std::string& field) const {
  for (const TensorField& candidate : fields_) {
    if (candidate.name == field) return &candidate;
  }
  return nullptr;
}

absl::Status TensorFile::Error(const std::string& field, const std::string& what) const {
  return absl::InvalidArgumentError(
      absl::StrCat(name_, ": field \"", Printable(field), "\": ", what));
}

absl::StatusOr<std::vector<uint8_t>> TensorFile::ReadBytes(const TensorField& field) const {
  std::vector<uint8_t> bytes(field.size_bytes);
  std::ifstream file(path_, std::ios::binary);
  file.seekg(static_cast<std::streamoff>(field.offset_bytes));
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  if (!file) return Error(field.name, "cannot be read: the file has changed or the disk fails");
  return bytes;
}

absl::StatusOr<std::vector<float>> TensorFile::ReadFloats(const TensorField& field) const {
  SHEAF_CHECK(field.type == TensorType::kFloat32);
  std::vector<float> values(field.ValueCount());
  std::ifstream file(path_, std::ios::binary);
  file.seekg(static_cast<std::streamoff>(field.offset_bytes));
  file.read(reinterpret_cast<char*>(values.data()), static_cast<std::streamsize>(field.size_bytes));
  if (!file) return Error(field.name, "cannot be read: the file has changed or the disk fails");
  return values;
}

}  // namespace sheaf
