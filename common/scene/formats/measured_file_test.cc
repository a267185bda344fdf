// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/measured_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "common/scene/formats/tensor_file.h"
#include "tests/support/measured_builder.h"
#include "tests/support/temporary_path.h"

namespace sheaf {
namespace {

using testing::FloatArray;
using ::testing::HasSubstr;
using testing::MeasuredFileBuilder;
using testing::TensorArray;
using testing::TensorBytes;

// Small, so that the test can try every one of its bytes.
MeasuredFileBuilder Small() {
  MeasuredFileBuilder builder;
  builder.theta = {0, 1.5f};
  builder.wavelengths = {400, 700};
  builder.normal_size = 3;
  builder.spectra_size = 2;
  return builder;
}

class MeasuredFileTest : public ::testing::Test {
 protected:
  ~MeasuredFileTest() override { std::filesystem::remove(path_); }

  absl::StatusOr<MeasuredData> Read(const std::string& bytes) {
    std::ofstream(path_, std::ios::binary | std::ios::trunc) << bytes;
    return ReadMeasuredFile("paint.bsdf", path_);
  }
  std::string ErrorOf(const std::string& bytes) {
    const absl::StatusOr<MeasuredData> data = Read(bytes);
    EXPECT_FALSE(data.ok());
    // The client's checks before it sends a scene must agree with what the worker reads.
    return data.ok() ? "" : std::string(data.status().message());
  }
  // The error if that array of a valid file is replaced.
  std::string ErrorWith(const TensorArray& replacement) {
    std::vector<TensorArray> arrays = Small().Arrays();
    for (TensorArray& array : arrays) {
      if (array.name == replacement.name) array = replacement;
    }
    return ErrorOf(TensorBytes(arrays));
  }

  const std::string path_ = testing::TemporaryPath("measured.bsdf");
};

TEST_F(MeasuredFileTest, RoundTrips) {
  const MeasuredFileBuilder builder = Small();
  const absl::StatusOr<MeasuredData> data = Read(builder.Bytes());
  ASSERT_TRUE(data.ok()) << data.status();
  EXPECT_EQ(data->theta, builder.theta);
  EXPECT_EQ(data->wavelengths, builder.wavelengths);
  EXPECT_TRUE(data->has_jacobian);
  EXPECT_TRUE(data->shape.IsIsotropic());
  EXPECT_EQ(data->vndf.size(), 2u * 9);
  EXPECT_EQ(data->spectra.size(), 2u * 2 * 4);
  float expected = 0;
  const std::vector<TensorArray> arrays = builder.Arrays();
  std::memcpy(&expected, arrays.back().bytes.data() + 4 * 5, 4);
  EXPECT_EQ(data->spectra[5], expected);
}

TEST_F(MeasuredFileTest, ErrorsNameFileAndField) {
  EXPECT_EQ(ErrorOf("PNG no tensor file"),
            "paint.bsdf: does not begin with \"tensor_file\"; is it a .bsdf file?");
  EXPECT_EQ(ErrorWith(FloatArray("vndf", {2, 9}, std::vector<float>(18))),
            "paint.bsdf: field \"vndf\": has 2 dimensions, but must have 4: phi_i, theta_i, phi_m, "
            "theta_m");
  EXPECT_EQ(ErrorWith(FloatArray("luminance", {1, 1, 2, 2}, std::vector<float>(4))),
            "paint.bsdf: field \"luminance\": has 1 values of theta_i, but theta_i has 2");
  EXPECT_EQ(ErrorWith(FloatArray("theta_i", {2}, {1, 1})),
            "paint.bsdf: field \"theta_i\": value 1 is 1 after 1, but values must increase");
  EXPECT_EQ(ErrorWith({"jacobian", 10, {1}, std::string(4, '\0')}),
            "paint.bsdf: field \"jacobian\": must be of type uint8");
  EXPECT_EQ(ErrorWith(FloatArray("ndf", {9, 1}, std::vector<float>(9))),
            "paint.bsdf: field \"ndf\": is 1 x 9, but must be at least 2 x 2");
  std::vector<float> negative(9, 1), infinite(9, 1);
  negative[4] = -1;
  infinite[3] = std::numeric_limits<float>::infinity();
  EXPECT_EQ(ErrorWith(FloatArray("ndf", {3, 3}, negative)),
            "paint.bsdf: field \"ndf\": value 4 is -1, but must be 0 or more");
  EXPECT_EQ(ErrorWith(FloatArray("sigma", {3, 3}, infinite)),
            "paint.bsdf: field \"sigma\": value 3 is inf, which is not finite");
  std::vector<TensorArray> arrays = Small().Arrays();
  arrays.pop_back();
  EXPECT_EQ(ErrorOf(TensorBytes(arrays)), "paint.bsdf: field \"spectra\": is missing");
  arrays.push_back(arrays.back());
  EXPECT_EQ(ErrorOf(TensorBytes(arrays)), "paint.bsdf: field \"luminance\": is there twice");
}

TEST_F(MeasuredFileTest, PartialCirclesAreRefused) {
  MeasuredFileBuilder builder = Small();
  builder.phi = {0, 1, 2, 3.14f};
  EXPECT_THAT(ErrorOf(builder.Bytes()), HasSubstr("field \"phi_i\": spans 3.14 radians"));
}

// Sizes whose product wraps around, that exceed the file, or whose ranges overlap others.
TEST_F(MeasuredFileTest, SizesBeyondTheFileAreRefused) {
  const std::string sound(12, '\0');
  for (const std::vector<uint64_t>& shape : {std::vector<uint64_t>{uint64_t{1} << 62, 4},
                                             {uint64_t{1} << 33, uint64_t{1} << 33},
                                             {uint64_t{1} << 40},
                                             {0},
                                             {3, ~uint64_t{0}}}) {
    EXPECT_THAT(ErrorWith({"theta_i", 10, shape, sound}), HasSubstr("field \"theta_i\": cannot"));
  }
  EXPECT_THAT(ErrorWith({"theta_i", 12, {3}, sound}), HasSubstr("unknown type 12"));
  EXPECT_THAT(ErrorWith({"theta_i", 10, std::vector<uint64_t>(17, 1), sound}),
              HasSubstr("17 dimensions, more than 16"));
  std::string many("tensor_file\0\1\0\xff\xff\xff\xff", 18);
  EXPECT_THAT(ErrorOf(many), HasSubstr("4294967295 fields, more than 256"));
  // Two fields at the same offset.
  std::vector<TensorArray> arrays = Small().Arrays();
  std::string bytes = TensorBytes(arrays);
  const uint64_t big = bytes.size() / 4 - 1;
  arrays.push_back({"x", 10, {big}, ""});
  arrays.push_back({"y", 10, {big}, ""});
  bytes = TensorBytes(arrays);
  const size_t x = bytes.find(std::string("\1\0x", 3)), y = bytes.find(std::string("\1\0y", 3));
  for (const size_t at : {x, y}) std::memset(&bytes[at + 3 + 3], 0, 8);
  EXPECT_THAT(ErrorOf(bytes), HasSubstr("overlaps other fields"));
}

// Every truncation is reported as an error; none crashes.
TEST_F(MeasuredFileTest, EveryTruncationIsAnError) {
  const std::string bytes = Small().Bytes();
  for (size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_THAT(ErrorOf(bytes.substr(0, size)), HasSubstr("paint.bsdf: ")) << size;
  }
  EXPECT_TRUE(Read(bytes).ok());
}

// With any single byte changed, the file is rejected or read to valid data. All of the head is
// tried, and some of the numbers.
TEST_F(MeasuredFileTest, CorruptBytesAreHandled) {
  const std::string bytes = Small().Bytes();
  const size_t head_size = bytes.find("test");
  for (size_t i = 0; i < bytes.size(); i += i < head_size ? 1 : 13) {
    for (const char flip : {'\x01', '\x80'}) {
      std::string wrong = bytes;
      wrong[i] = static_cast<char>(wrong[i] ^ flip);
      const absl::StatusOr<MeasuredData> data = Read(wrong);
      if (!data.ok()) continue;
      EXPECT_EQ(data->spectra.size(), data->phi.size() * data->theta.size() *
                                          data->wavelengths.size() * data->shape.spectra_size *
                                          data->shape.spectra_size);
      EXPECT_TRUE(std::all_of(data->vndf.begin(), data->vndf.end(),
                              [](float v) { return std::isfinite(v) && v >= 0; }));
    }
  }
}

TEST_F(MeasuredFileTest, MissingFilesAreReported) {
  EXPECT_EQ(ReadMeasuredShape("a.bsdf", path_ + "-none").status().message(),
            "a.bsdf: cannot be opened");
}

}  // namespace
}  // namespace sheaf
