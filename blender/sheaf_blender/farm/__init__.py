# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The program `sheaf`, the coordinator's page and the images that come back. Needs no Blender."""
