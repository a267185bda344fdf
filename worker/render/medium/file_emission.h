// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ResolveFileEmission: whether media in files emit. Runs before a scene is planned, because a scene
// describes such a medium before its file is read.
#pragma once

#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "common/volume/volume_file.h"

namespace sheaf::render {

// Makes media dark whose files have no grid of temperatures, where the scene names none. Files that
// cannot be listed change nothing; reading them reports the error. volumes: reads the files; null:
// they are closed afterwards.
void ResolveFileEmission(FileSource& files, SceneDescription* scene,
                         VolumeReader* volumes = nullptr);

}  // namespace sheaf::render
