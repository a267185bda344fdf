# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The list of kinds of faults, in the order of the table."""
import dataclasses
from collections.abc import Callable


@dataclasses.dataclass(frozen=True)
class Kind:
    name: str
    cause: Callable  # Gets a Bench.
    bench: str       # The name of the farm in which it happens.
    must_tell: bool  # Whether the farm must report it to users.
    needs: str       # The machine's needs beyond programs: "", "mounts", "tunnels" ...
    spoils: bool     # Whether the farm is of no further use: the next fault gets another one.


KINDS = []


def kind(name, bench="machine", must_tell=False, needs="", spoils=False):
    """Adds the function below to the kinds."""
    def add(cause):
        KINDS.append(Kind(name, cause, bench, must_tell, needs, spoils))
        return cause
    return add
