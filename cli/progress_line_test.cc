// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
