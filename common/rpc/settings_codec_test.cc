// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/settings_codec.h"

#include <cmath>

#include "absl/strings/escaping.h"
#include "gtest/gtest.h"

namespace sheaf {
namespace {

FrameSettings EverySetting() {
  FrameSettings settings;
  settings.width_px = 640;
  settings.height_px = 480;
  settings.window = {1, 2, 300, 400};
  settings.samples = uint64_t{1} << 40;
  settings.max_depth = 17;
  settings.seed = ~uint64_t{0};
  settings.single_scattering = true;
  settings.one_sequence = true;
  settings.similarity_after = 12;
  settings.light_samples = 8;
  settings.techniques = TechniqueSet::kCameraAndLight;
  settings.lattice = {8, settings.seed};
  settings.force_generic_variant = true;
  settings.outputs.Add(Aov::kPosition);
  settings.outputs.Add(Aov::kMotion);
  settings.outputs.camera_space = true;
  settings.primaries = Primaries::kAcesCg;
  settings.white_balance_k = 5600.25f;
  settings.sensor = "nikon_d850";
  settings.max_component_value = 12.5f;
  return settings;
}

// The digest's text names every setting that decides a pixel: equal texts, equal images.
TEST(SettingsCodecTest, EverySettingRoundTrips) {
  FrameSettings settings = EverySetting();
  for (const ColorTransport color :
       {ColorTransport::kAuto, ColorTransport::kRgb, ColorTransport::kSpectral}) {
    settings.color = color;
    const absl::StatusOr<FrameSettings> back = FromWire(ToWire(settings));
    ASSERT_TRUE(back.ok()) << back.status();
    EXPECT_EQ(FrameDigestText("scene", *back, "profile"),
              FrameDigestText("scene", settings, "profile"));
    EXPECT_TRUE(back->force_generic_variant);
    EXPECT_EQ(back->lattice, settings.lattice);
    EXPECT_EQ(back->outputs, settings.outputs);
    EXPECT_EQ(back->primaries, settings.primaries);
    EXPECT_EQ(back->white_balance_k, settings.white_balance_k);
    EXPECT_EQ(back->similarity_after, settings.similarity_after);
  }
}

// Coordinators and workers of one version, and jobs that are stored, agree on these bytes.
TEST(SettingsCodecTest, MessagesKeepTheirBytes) {
  FrameSettings settings = EverySetting();
  settings.color = ColorTransport::kSpectral;
  EXPECT_EQ(absl::BytesToHexString(ToWire(settings).SerializeAsString()),
            "08800510e0031a0a0801100218ac0220900320808080808020281130ffffffffffffffffff013801"
            "40024801521c706f736974696f6e2c6d6f74696f6e2c73706163653a63616d6572615804650002af"
            "456801700c780882010a6e696b6f6e5f643835308d0100004841900101980108");
  EXPECT_EQ(absl::BytesToHexString(ToWire(FrameSettings()).SerializeAsString()), "1a0020102805");
}

TEST(SettingsCodecTest, UnknownColorTransportBecomesAuto) {
  v1::FrameSettings wire;
  wire.set_color(static_cast<v1::ColorTransport>(99));
  EXPECT_EQ(FromWire(wire)->color, ColorTransport::kAuto);
}

// An image in other primaries than requested would be wrong.
TEST(SettingsCodecTest, UnknownPrimariesAreRefused) {
  v1::FrameSettings wire;
  wire.set_primaries(static_cast<v1::Primaries>(99));
  EXPECT_EQ(FromWire(wire).status().code(), absl::StatusCode::kInvalidArgument);
  wire.set_primaries(v1::PRIMARIES_REC2020);
  EXPECT_TRUE(FromWire(wire).ok());
  for (const float temperature_k : {-1.0f, 999.0f, 1e9f, NAN}) {
    wire.set_white_balance_k(temperature_k);
    EXPECT_EQ(FromWire(wire).status().code(), absl::StatusCode::kInvalidArgument);
  }
}

TEST(SettingsCodecTest, EveryTechniqueRoundTripsAndOthersAreRefused) {
  for (const std::string& name : TechniquesNames()) {
    FrameSettings settings;
    settings.techniques = *TechniqueSet::Parse(name);
    const absl::StatusOr<FrameSettings> back = FromWire(ToWire(settings));
    ASSERT_TRUE(back.ok()) << back.status();
    EXPECT_EQ(back->techniques, settings.techniques);
  }
  FrameSettings guided;
  guided.techniques = TechniqueSet::kCameraGuided;
  EXPECT_EQ(ToWire(guided).techniques(), v1::TECHNIQUES_CAMERA_GUIDED);
  for (const int number : {-1, 7, 15, 16, 16 + 0b1010, 16 + (1 << 20), 16 + (1 << 15)}) {
    v1::FrameSettings wire;
    wire.set_techniques(static_cast<v1::Techniques>(number));
    EXPECT_EQ(FromWire(wire).status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_NE(FromWire(wire).status().message().find("techniques"), std::string::npos);
  }
}

TEST(SettingsCodecTest, UnknownSensorsAndClampsAreRefused) {
  v1::FrameSettings wire;
  wire.set_sensor("camera_of_tomorrow");
  EXPECT_EQ(FromWire(wire).status().code(), absl::StatusCode::kInvalidArgument);
  wire.set_sensor("canon_eos_100d");
  EXPECT_TRUE(FromWire(wire).ok());
  for (const float value : {-1.0f, HUGE_VALF, NAN}) {
    wire.set_max_component_value(value);
    EXPECT_EQ(FromWire(wire).status().code(), absl::StatusCode::kInvalidArgument);
  }
}

TEST(SettingsCodecTest, SimilarityOutOfRangeIsRefused) {
  for (const int32_t after : {-1, kSimilarityAfterMax + 1}) {
    v1::FrameSettings wire;
    wire.set_similarity_after_count(after);
    EXPECT_EQ(FromWire(wire).status().code(), absl::StatusCode::kInvalidArgument);
  }
}

TEST(SettingsCodecTest, LightSamplesOutOfRangeAreRefused) {
  for (const int32_t count : {-1, 1, kLightSamplesMax + 1}) {
    v1::FrameSettings wire;
    wire.set_light_samples_max(count);
    EXPECT_EQ(FromWire(wire).status().code(), absl::StatusCode::kInvalidArgument) << count;
  }
  v1::FrameSettings wire;
  wire.set_light_samples_max(kLightSamplesMax);
  EXPECT_EQ(FromWire(wire)->light_samples, kLightSamplesMax);
}

TEST(SettingsCodecTest, UnknownOutputsAreRefused) {
  v1::FrameSettings wire;
  wire.set_outputs("position,of-tomorrow");
  EXPECT_EQ(FromWire(wire).status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace sheaf
