// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/measured_file.h"

#include <cmath>
#include <initializer_list>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/math/elementary.h"
#include "common/scene/formats/tensor_file.h"

namespace sheaf {
namespace {

// Checks field after field; the first error is sticky.
class ShapeChecker {
 public:
  explicit ShapeChecker(const TensorFile& file) : file_(file) {}

  const absl::Status& status() const { return status_; }
  void Fail(const std::string& field, const std::string& what) {
    if (status_.ok()) status_ = file_.Error(field, what);
  }

  // The sizes of a field of that type and rank; zeros otherwise. names: of its dimensions.
  std::vector<uint32_t> Sizes(const std::string& name, TensorType type,
                              std::initializer_list<const char*> names) {
    std::vector<uint32_t> sizes(names.size(), 0);
    const TensorField* field = file_.Find(name);
    if (field == nullptr) {
      Fail(name, "is missing");
    } else if (field->type != type) {
      Fail(name,
           type == TensorType::kFloat32 ? "must be of type float32" : "must be of type uint8");
    } else if (field->shape.size() != names.size()) {
      std::string list;
      for (const char* n : names) absl::StrAppend(&list, list.empty() ? "" : ", ", n);
      Fail(name, absl::StrCat("has ", field->shape.size(), " dimensions, but must have ",
                              names.size(), ": ", list));
    } else {
      // Sizes fit in files of at most kTensorFileBytesMax bytes.
      for (size_t i = 0; i < sizes.size(); ++i) sizes[i] = static_cast<uint32_t>(field->shape[i]);
    }
    return sizes;
  }
  void Equal(const std::string& field, const char* dimension, uint32_t size, const char* of,
             uint32_t expected) {
    if (size == expected) return;
    Fail(field,
         absl::StrCat("has ", size, " values of ", dimension, ", but ", of, " has ", expected));
  }
  // Bilinear interpolation needs two values each way.
  void AtLeastTwo(const std::string& field, uint32_t width, uint32_t height) {
    if (width < 2 || height < 2) {
      Fail(field, absl::StrCat("is ", width, " x ", height, ", but must be at least 2 x 2"));
    }
  }

 private:
  const TensorFile& file_;
  absl::Status status_;
};

absl::StatusOr<MeasuredShape> ShapeOf(const TensorFile& file) {
  ShapeChecker check(file);
  constexpr TensorType kFloat = TensorType::kFloat32;
  MeasuredShape shape;
  shape.phi_count = check.Sizes("phi_i", kFloat, {"phi_i"})[0];
  shape.theta_count = check.Sizes("theta_i", kFloat, {"theta_i"})[0];
  shape.wavelength_count = check.Sizes("wavelengths", kFloat, {"wavelengths"})[0];
  const auto jacobian = check.Sizes("jacobian", TensorType::kUint8, {"flag"});
  if (jacobian[0] > 1) check.Fail("jacobian", "must be one value");
  const auto ndf = check.Sizes("ndf", kFloat, {"phi_m", "theta_m"});
  const auto sigma = check.Sizes("sigma", kFloat, {"phi_i", "theta_i"});
  const auto vndf = check.Sizes("vndf", kFloat, {"phi_i", "theta_i", "phi_m", "theta_m"});
  const auto luminance = check.Sizes("luminance", kFloat, {"phi_i", "theta_i", "v", "u"});
  const auto spectra =
      check.Sizes("spectra", kFloat, {"phi_i", "theta_i", "wavelengths", "v", "u"});
  const struct {
    const char* name;
    const std::vector<uint32_t>& sizes;
  } by_incidence[] = {{"vndf", vndf}, {"luminance", luminance}, {"spectra", spectra}};
  for (const auto& field : by_incidence) {
    check.Equal(field.name, "phi_i", field.sizes[0], "phi_i", shape.phi_count);
    check.Equal(field.name, "theta_i", field.sizes[1], "theta_i", shape.theta_count);
  }
  check.Equal("spectra", "wavelengths", spectra[2], "wavelengths", shape.wavelength_count);
  check.Equal("luminance", "u", luminance[3], "its v", luminance[2]);
  check.Equal("spectra", "v", spectra[3], "luminance", luminance[2]);
  check.Equal("spectra", "u", spectra[4], "luminance", luminance[3]);
  shape.ndf_height = ndf[0];
  shape.ndf_width = ndf[1];
  shape.sigma_height = sigma[0];
  shape.sigma_width = sigma[1];
  shape.vndf_height = vndf[2];
  shape.vndf_width = vndf[3];
  shape.spectra_size = spectra[4];
  check.AtLeastTwo("ndf", shape.ndf_width, shape.ndf_height);
  check.AtLeastTwo("sigma", shape.sigma_width, shape.sigma_height);
  check.AtLeastTwo("vndf", shape.vndf_width, shape.vndf_height);
  check.AtLeastTwo("spectra", shape.spectra_size, shape.spectra_size);
  if (!check.status().ok()) return check.status();
  return shape;
}

// Values of a field that ShapeOf has checked, each finite and in [low, infinity).
absl::Status ReadValues(const TensorFile& file, const std::string& field, float low,
                        std::vector<float>* values) {
  absl::StatusOr<std::vector<float>> read = file.ReadFloats(*file.Find(field));
  if (!read.ok()) return read.status();
  for (size_t i = 0; i < read->size(); ++i) {
    const float value = (*read)[i];
    if (std::isfinite(value) && value >= low) continue;
    return file.Error(field, absl::StrCat("value ", i, " is ", value,
                                          std::isfinite(value) ? ", but must be 0 or more"
                                                               : ", which is not finite"));
  }
  *values = *std::move(read);
  return absl::OkStatus();
}

absl::Status CheckIncreasing(const TensorFile& file, const std::string& field,
                             const std::vector<float>& values) {
  for (size_t i = 1; i < values.size(); ++i) {
    if (values[i] > values[i - 1]) continue;
    return file.Error(field, absl::StrCat("value ", i, " is ", values[i], " after ", values[i - 1],
                                          ", but values must increase"));
  }
  return absl::OkStatus();
}

// Materials may be measured over part of the circle if the rest follows by symmetry.
absl::Status CheckCircle(const TensorFile& file, const MeasuredData& data) {
  if (data.shape.IsIsotropic()) return absl::OkStatus();
  const double range = static_cast<double>(data.phi.back()) - static_cast<double>(data.phi.front());
  constexpr double kRangeMin = 2 * kPi / 1.5;  // Nearer to the full circle than to half of it.
  if (range > kRangeMin) return absl::OkStatus();
  return file.Error("phi_i", absl::StrCat("spans ", range,
                                          " radians; anisotropic materials that are measured over "
                                          "part of the circle are not supported"));
}

}  // namespace

absl::StatusOr<MeasuredShape> ReadMeasuredShape(const std::string& name, const std::string& path) {
  const absl::StatusOr<TensorFile> file = TensorFile::Open(name, path);
  if (!file.ok()) return file.status();
  return ShapeOf(*file);
}

absl::StatusOr<MeasuredData> ReadMeasuredFile(const std::string& name, const std::string& path) {
  const absl::StatusOr<TensorFile> file = TensorFile::Open(name, path);
  if (!file.ok()) return file.status();
  const absl::StatusOr<MeasuredShape> shape = ShapeOf(*file);
  if (!shape.ok()) return shape.status();
  MeasuredData data;
  data.shape = *shape;
  const absl::StatusOr<std::vector<uint8_t>> jacobian = file->ReadBytes(*file->Find("jacobian"));
  if (!jacobian.ok()) return jacobian.status();
  data.has_jacobian = (*jacobian)[0] != 0;
  constexpr float kAny = std::numeric_limits<float>::lowest();
  const struct {
    const char* name;
    float low;
    std::vector<float>* values;
  } fields[] = {{"phi_i", kAny, &data.phi},
                {"theta_i", kAny, &data.theta},
                {"wavelengths", 0, &data.wavelengths},
                {"ndf", 0, &data.ndf},
                {"sigma", 0, &data.sigma},
                {"vndf", 0, &data.vndf},
                {"luminance", 0, &data.luminance},
                {"spectra", kAny, &data.spectra}};
  for (const auto& field : fields) {
    absl::Status status = ReadValues(*file, field.name, field.low, field.values);
    if (!status.ok()) return status;
  }
  for (const auto& field : {fields[0], fields[1], fields[2]}) {
    absl::Status status = CheckIncreasing(*file, field.name, *field.values);
    if (!status.ok()) return status;
  }
  if (absl::Status status = CheckCircle(*file, data); !status.ok()) return status;
  return data;
}

}  // namespace sheaf
