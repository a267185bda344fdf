# SPDX-License-Identifier: Apache-2.0
# Workers that return false results. The long form: SHEAF_LONG_TESTS=1 ctest -R LiarsTest.
sheaf_add_test(NAME liars LABEL integration SOURCES faults/liars_test.cc
  DEPS sheaf::coordinator_server sheaf::synthetic_worker PRECOMPILED sheaf_proto_test_headers)
