// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/material/texture_program.h"

#include <array>
#include <fstream>
#include <map>
#include <string>
#include <utility>

#include "common/scene/spectrum/primaries.h"
#include "gtest/gtest.h"
#include "tests/support/image_files.h"
#include "tests/support/temporary_path.h"
#include "worker/render/material/material.h"

namespace sheaf::render {
namespace {

using sheaf::testing::ExrBytes;
using sheaf::testing::PngBytes;
using sheaf::testing::TemporaryPath;

constexpr std::array<float, 8> kAp1{.713f, .293f, .165f, .83f, .128f, .044f, .32168f, .33767f};

// Textures over one image.
class TextureProgramTest : public ::testing::Test {
 protected:
  void Write(const std::string& name, const std::string& bytes) {
    paths_[name] = TemporaryPath(name);
    std::ofstream(paths_[name], std::ios::binary) << bytes;
    image_.file = name;
  }
  int32_t Add(bool is_color, decltype(TextureDescription::texture) texture) {
    TextureDescription description;
    description.is_color = is_color;
    description.texture = std::move(texture);
    scene_.textures.push_back(std::move(description));
    return static_cast<int32_t>(scene_.textures.size()) - 1;
  }
  template <typename Color>
  Color ColorAt(int32_t texture, const WavelengthsOf<Color>& wavelengths) {
    Build(std::is_same_v<Color, Spectral>);
    ColorInput input;
    input.texture = texture;
    return program_->Value<Color>(program_->Operand(input, ColorRole::kReflectance), {},
                                  wavelengths);
  }
  Rgb ColorAt(int32_t texture) { return ColorAt<Rgb>(texture, {}); }
  float FloatAt(int32_t texture) {
    Build(false);
    FloatInput input;
    input.texture = texture;
    return program_->Float(program_->Operand(input), {});
  }

  SceneDescription scene_;
  ImageTexture image_;

 private:
  void Build(bool spectral) {
    TableFileSource files(paths_);
    auto program = TextureProgram::Build(scene_, files, cache_, spectral);
    ASSERT_TRUE(program.ok()) << program.status();
    program_ = std::make_unique<TextureProgram>(*std::move(program));
  }

  std::map<std::string, std::string> paths_;
  TextureCache cache_{uint64_t{1} << 20};
  std::unique_ptr<TextureProgram> program_;
};

// An opaque alpha is no mask.
TEST_F(TextureProgramTest, FloatsOfOpaqueImagesAreTheMeanOfTheColors) {
  image_.encoding = ColorEncoding::kLinear;
  for (const auto& [alpha, expected] : {std::pair{255, 60 / 255.f}, std::pair{51, 51 / 255.f}}) {
    Write(std::to_string(alpha) + ".png",
          PngBytes(1, 1, 8, 6, std::string{30, 60, 90} + static_cast<char>(alpha)));
    scene_.textures.clear();
    EXPECT_NEAR(FloatAt(Add(false, image_)), expected, 1e-6f) << alpha;
  }
}

TEST_F(TextureProgramTest, ColorsOfImagesAreInThePrimariesOfTheirHeader) {
  Write("ap1.exr",
        ExrBytes({.channels = {{"R", .5f}, {"G", .2f}, {"B", .1f}}, .chromaticities = kAp1}));
  const int32_t color = Add(true, image_), number = Add(false, image_);
  const Rgb expected =
      SrgbFromPrimaries({.5f, .2f, .1f}, Primaries::kAcesCg, ColorRole::kReflectance);
  const Rgb converted = ColorAt(color);
  for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(converted[c], expected[c], 2e-3f);
  EXPECT_NEAR(FloatAt(number), .8f / 3, 1e-6f);  // Numbers have no primaries.
  MaterialDescription material;
  material.normal_map = color;  // Nor have directions.
  scene_.materials.push_back(material);
  EXPECT_EQ(ColorAt(color), (Rgb{.5f, .2f, .1f}));
}

TEST_F(TextureProgramTest, WhiteOfAnyPrimariesReflectsEverything) {
  Write("white.exr",
        ExrBytes({.channels = {{"R", 1}, {"G", 1}, {"B", 1}}, .chromaticities = kAp1}));
  EXPECT_EQ(ColorAt(Add(true, image_)), Rgb::Gray(1));
}

TEST_F(TextureProgramTest, PrimariesThatDefineNoColorAreThoseOfSrgb) {
  Write("none.exr", ExrBytes({.channels = {{"R", .5f}, {"G", .2f}, {"B", .1f}},
                              .chromaticities = std::array<float, 8>{}}));
  EXPECT_EQ(ColorAt(Add(true, image_)), (Rgb{.5f, .2f, .1f}));
}

// Brighter than 1, where a reflectance ends. It ends there before it becomes a spectrum.
TEST_F(TextureProgramTest, ConstantScalesOfImagesAreTheScaleOfTheImage) {
  Write("color.png", PngBytes(1, 1, 8, 2, std::string("\xe0\x90\x40")));
  const Wavelengths wavelengths = Wavelengths::Sample(0.3f);
  const int32_t plain = Add(true, image_);
  ScaleTexture scale;
  scale.color.texture = plain;
  scale.scale.value = 3;
  const int32_t scaled = Add(true, scale);
  image_.scale = 3;
  const int32_t bright = Add(true, image_);
  EXPECT_EQ(ColorAt(scaled), ColorAt(bright));
  const Spectral a = ColorAt<Spectral>(scaled, wavelengths),
                 b = ColorAt<Spectral>(bright, wavelengths);
  for (size_t i = 0; i < kWavelengthCount; ++i) {
    EXPECT_EQ(a[i], b[i]);
    EXPECT_LE(a[i], 1);
  }
  // The product is that of the inverted image.
  image_.scale = 1;
  image_.invert = true;
  scale.color.texture = Add(true, image_);
  const Rgb inverted = ColorAt(scale.color.texture);
  EXPECT_EQ(ColorAt(Add(true, scale)), inverted * 3);
}

}  // namespace
}  // namespace sheaf::render
