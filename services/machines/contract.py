"""What a machine must publish and obey; `services.machines.conformance` tries it on any adapter.

A machine is a node (`services.bus.Node`): messages in, messages out, no bus and no clock of the loop. It

- answers each `Tick` with one `SampleBlock` (servo samples of 10 ms, contiguous, at the rate of the case), one
  `MachineState`, a `Truth` if it is simulated, and an `Event` for whatever happened;
- takes `TurretCommand` (an absolute shift, with the time from which it applies and the time at which it is void) and
  `OperatorRequest` (arm, dry_run, disarm, stop, reset), and lets nothing of it pass but through `services.guard.Guard`;
- boots OFF, moves nothing while OFF, holds the shift when commands stay away, latches FAULT, and goes on only after a
  reset by the operator;
- publishes in `MachineState` where the turret is, as read back from the control and not as wished.

Whoever builds on `services.nodes.machine.MachineNode` has the guard, the path and the messages already, and replaces
three methods: `_conditions` (what the control says of itself, where it measures the turret), `_drive` (hand the checked
set points to the control, return the servo samples) and, for a slower control, `_path_limits`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, runtime_checkable

from services.config import Case
from services.messages import Message, OperatorRequest, Tick, TurretCommand


@runtime_checkable
class Machine(Protocol):
    """A machine at the end of the bus."""

    @property
    def subscribes(self) -> tuple[type[Tick] | type[TurretCommand] | type[OperatorRequest], ...]:
        """All three types, in any order."""
        ...

    def prepare(self) -> None:
        """Compile, connect, and refuse what cannot work before anything moves."""
        ...

    def handle(self, message: Tick | TurretCommand | OperatorRequest, /) -> list[Message]:
        """Advance by one block, or take a command or request."""
        ...


Make = Callable[[Case, int, str], Machine]
"""Makes a machine from case, seed and identifier of the run."""
