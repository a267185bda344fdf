// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/server/build_info.h"

#include "common/scene/settings/render_settings.h"

namespace sheaf::coordinator {
namespace {

#ifdef __clang__
constexpr char kCompiler[] = "clang " __clang_version__;
#else
constexpr char kCompiler[] = "gcc " __VERSION__;
#endif

}  // namespace

BuildInfo CoordinatorBuild() {
  return {SHEAF_VERSION, SHEAF_REVISION, kCompiler, NumericProfile()};
}

}  // namespace sheaf::coordinator
