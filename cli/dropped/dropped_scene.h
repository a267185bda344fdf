// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RunDroppedScene: the process that makes a job of dropped files, for the coordinator, which does
// not read scenes itself.
#pragma once

namespace sheaf::cli {

// The only argument of such a process; used only by sheaf-coordinator.
inline constexpr char kDroppedSceneFlag[] = "--dropped-scene";

// The whole program: reads a v1::PrepareRequest from standard input, confines itself, and writes a
// v1::PrepareReply to standard output. Returns the exit code. Requires: one thread.
int RunDroppedScene();

}  // namespace sheaf::cli
