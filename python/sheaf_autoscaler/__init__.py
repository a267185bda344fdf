# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""sheaf-autoscaler: keeps as many workers as a coordinator's jobs need (docs/elastic.md).

    CoordinatorReader.look > Look > workers_wanted > Controller.step > Engine.grow, Engine.shrink

The engine owns machines, the coordinator owns leases of samples. Nothing here decides what is
rendered: the program may be killed at any time, and starts again without a state of its own. Only
coordinator.py needs gRPC.
"""
