// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/settings/techniques.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "common/scene/settings/render_settings.h"

namespace sheaf {
namespace {

// The sets of messages and stored jobs of earlier versions, by their numbers.
const std::vector<std::string> kNumberedNames{"camera",
                                              "camera+light",
                                              "light",
                                              "camera+guiding",
                                              "camera+light+guiding",
                                              "camera+guiding+splitting",
                                              "camera+light+guiding+splitting"};

std::string ErrorOf(const std::string& name) {
  return std::string(TechniqueSet::Parse(name).status().message());
}

TEST(TechniqueSetTest, NamesAndNumbersOfEarlierVersionsStay) {
  for (size_t number = 0; number < kNumberedNames.size(); ++number) {
    const std::optional<TechniqueSet> set = TechniqueSet::FromNumber(static_cast<int64_t>(number));
    ASSERT_TRUE(set.has_value());
    EXPECT_EQ(set->Name(), kNumberedNames[number]);
    EXPECT_EQ(set->Number(), static_cast<int>(number));
  }
  const std::vector<std::string> names = TechniquesNames();
  ASSERT_GE(names.size(), kNumberedNames.size());
  EXPECT_TRUE(std::equal(kNumberedNames.begin(), kNumberedNames.end(), names.begin()));
}

TEST(TechniqueSetTest, EverySetRoundTripsByNameAndNumber) {
  std::set<std::string> names;
  std::set<int> numbers;
  for (const TechniqueSet set : TechniqueSet::All()) {
    EXPECT_TRUE(names.insert(set.Name()).second) << set.Name();
    EXPECT_TRUE(numbers.insert(set.Number()).second) << set.Name();
    const absl::StatusOr<TechniqueSet> parsed = TechniqueSet::Parse(set.Name());
    ASSERT_TRUE(parsed.ok()) << parsed.status();
    EXPECT_EQ(*parsed, set) << set.Name();
    EXPECT_EQ(TechniqueSet::FromNumber(set.Number()), set) << set.Name();
  }
}

TEST(TechniqueSetTest, NumbersOfNoSetAreNone) {
  const int bits_of_camera = TechniqueSet::kNumberOfBits;  // It has the number 0.
  for (const int64_t number : {int64_t{-1}, int64_t{7}, int64_t{15}, int64_t{bits_of_camera},
                               int64_t{16 + 0b1010}, int64_t{16 + 0x8000}, int64_t{1} << 40}) {
    EXPECT_EQ(TechniqueSet::FromNumber(number), std::nullopt) << number;
  }
}

TEST(TechniqueSetTest, WordsHaveAnyOrderAndCase) {
  EXPECT_EQ(TechniqueSet::Parse("Guiding+LIGHT+camera")->Name(), "camera+light+guiding");
  EXPECT_EQ(TechniqueSet::Parse("splitting+camera+guiding")->Name(), "camera+guiding+splitting");
  EXPECT_EQ(*TechniqueSet::Parse("light+camera"), TechniqueSet::kCameraAndLight);
}

TEST(TechniqueSetTest, ErrorsSayWhatToGive) {
  EXPECT_EQ(ErrorOf("camera+splitting"),
            "\"camera+splitting\": splitting needs guiding; give camera+guiding+splitting");
  EXPECT_EQ(ErrorOf("light+guiding"),
            "\"light+guiding\": guiding needs camera; give camera+light+guiding");
  EXPECT_EQ(ErrorOf("light+splitting"),
            "\"light+splitting\": splitting needs guiding; give camera+light+guiding+splitting");
  EXPECT_EQ(ErrorOf("camera+emission-guiding"),
            "\"camera+emission-guiding\": emission-guiding needs light; give "
            "camera+light+emission-guiding");
  EXPECT_EQ(ErrorOf("camera+views"),
            "\"camera+views\": views needs sharing; give camera+sharing+views");
  EXPECT_EQ(ErrorOf("guiding"), "\"guiding\": guiding needs camera; give camera+guiding");
  for (const char* name : {"lights", "unknown", "", "camera+", "camera light"}) {
    EXPECT_EQ(TechniqueSet::Parse(name).status().code(), absl::StatusCode::kNotFound) << name;
  }
}

TEST(TechniqueSetTest, NamesTellWhatASetHas) {
  for (const TechniqueSet set : TechniqueSet::All()) {
    const std::string name = set.Name();
    const std::string words = "+" + name + "+";
    EXPECT_EQ(HasLightPaths(set), words.find("+light+") != std::string::npos) << name;
    EXPECT_EQ(LearnsLights(set), words.find("+learned-lights+") != std::string::npos) << name;
    EXPECT_EQ(set.Has(Technique::kProduct), words.find("+product+") != std::string::npos) << name;
    EXPECT_EQ(ChoosesByProduct(set), set.Has(Technique::kProduct) && !HasLightPaths(set)) << name;
    EXPECT_EQ(IsGuided(set), name.find("+guiding") != std::string::npos) << name;
    EXPECT_EQ(SplitsPaths(set), name.find("splitting") != std::string::npos) << name;
    EXPECT_EQ(GuidesEmission(set), name.find("+emission-guiding") != std::string::npos) << name;
    EXPECT_EQ(SharesPaths(set), name.find("sharing") != std::string::npos) << name;
    EXPECT_EQ(SharesViews(set), name.find("views") != std::string::npos) << name;
    EXPECT_EQ(MutatesPaths(set), name.find("mutations") != std::string::npos) << name;
    EXPECT_EQ(HasChains(set), name.find("chains") != std::string::npos) << name;
    EXPECT_EQ(NeedsTraining(set), name.find("guiding") != std::string::npos || LearnsLights(set))
        << name;
    EXPECT_NE(set.Has(Technique::kLightPathsAlone), name.starts_with("camera")) << name;
  }
}

TEST(TechniqueSetTest, SetsGrowWithWhatTechniquesNeedAndShrinkWithThoseThatNeedThem) {
  for (const TechniqueSet set : TechniqueSet::All()) {
    const TechniqueSet camera = set.Without(Technique::kLightPaths);
    EXPECT_FALSE(HasLightPaths(camera)) << set.Name();
    EXPECT_EQ(IsGuided(camera), IsGuided(set)) << set.Name();
    EXPECT_EQ(SplitsPaths(camera), SplitsPaths(set)) << set.Name();
    EXPECT_FALSE(GuidesEmission(camera)) << set.Name();
    const TechniqueSet unguided = set.Without(Technique::kGuiding);
    EXPECT_FALSE(IsGuided(unguided) || SplitsPaths(unguided)) << set.Name();
    EXPECT_EQ(HasLightPaths(unguided), HasLightPaths(set)) << set.Name();
    EXPECT_EQ(GuidesEmission(unguided), GuidesEmission(set)) << set.Name();
    const TechniqueSet split = set.With(Technique::kSplitting);
    EXPECT_TRUE(IsGuided(split) && SplitsPaths(split)) << set.Name();
    EXPECT_EQ(HasLightPaths(split), HasLightPaths(set)) << set.Name();
    for (const TechniqueSet changed : {camera, unguided, split}) {
      EXPECT_TRUE(TechniqueSet::FromNumber(changed.Number()).has_value()) << changed.Name();
    }
  }
  EXPECT_EQ(TechniqueSet::kLight.Without(Technique::kLightPaths), TechniqueSet::kCamera);
}

// Parts of earlier versions stay valid.
TEST(TechniqueSetTest, DigestsOfEarlierVersionsStay) {
  FrameSettings settings;
  const std::string camera = FrameDigestText("scene", settings, "profile");
  for (const std::string& name : kNumberedNames) {
    settings.techniques = *TechniqueSet::Parse(name);
    std::string expected = camera;
    if (name != "camera") {
      expected.insert(expected.find("profile profile\n"), "techniques " + name + "\n");
    }
    EXPECT_EQ(FrameDigestText("scene", settings, "profile"), expected);
  }
}

}  // namespace
}  // namespace sheaf
