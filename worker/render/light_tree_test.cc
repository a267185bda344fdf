// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light_tree.h"

#include <gtest/gtest.h>
TEST(LightTreeTest, X) {}
