// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/ablation/technique_choices.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sheaf::render {
namespace {

using ::testing::HasSubstr;

TEST(TechniqueChoicesTest, EveryTechniqueIsListedOrAskedFor) {
  for (const TechniqueSet set : TechniqueSet::All()) {
    const bool is_asked_for =
        set.Has(Technique::kLightPathsAlone) || set.Has(Technique::kMutations);
    // Frames have sharing and chains beside no other technique.
    const bool is_refused =
        (set.Has(Technique::kSharing) &&
         set.Without(Technique::kSharing) != TechniqueSet::kCamera) ||
        (set.Has(Technique::kChains) && set.Without(Technique::kChains) != TechniqueSet::kCamera);
    EXPECT_EQ(IsTechniqueChoice(set), !is_asked_for && !is_refused) << set.Name();
  }
}

TEST(TechniqueChoicesTest, TheTextHasAll) {
  const std::string text = FormatTechniqueChoices();
  for (const char* words :
       {" of camera, camera+light, camera+guiding, camera+light+guiding; of these with ",
        "+splitting, ", "+learned-lights, ", "+product, ", "+emission-guiding, ", "+merging where",
        "; of camera+chains where", " of camera with +sharing, +sharing+views where"}) {
    EXPECT_THAT(text, HasSubstr(words));
  }
}

}  // namespace
}  // namespace sheaf::render
