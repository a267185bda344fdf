// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RunSceneProcess: the other end of SceneProcess, in the process of one scene.
//
//     ConfineRequest, once > LoadSceneRequest, once > RenderTaskRequest, any number, and among them
//     SetFieldRequest, at most once
#pragma once

#include "worker/sandbox/scene_opener.h"

namespace sheaf::worker {

// The whole program of a scene's process: serves the requests that come over kSceneSocket until the
// worker closes it, and returns the exit code. Requires: one thread.
int RunSceneProcess(SceneOpener* scenes);

// The only argument of a program that is the process of one scene. It is for the programs that
// start such processes alone, sheaf-worker and sheaf.
inline constexpr char kSceneProcessFlag[] = "--scene-process";
// RunSceneProcess with DirectScenes that take at most the memory that this process may.
int RunDirectSceneProcess();

}  // namespace sheaf::worker
