# SPDX-License-Identifier: Apache-2.0
# Kills of the store within group commits. The long form: SHEAF_KILLS=200 build/release/bin/sheaf_group_kill_test.
sheaf_add_test(NAME group_kill LABEL integration SOURCES faults/group_kill_test.cc
  DEPS sheaf::coordinator_store)
