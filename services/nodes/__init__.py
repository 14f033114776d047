"""Machine, monitor and controller: `handle(message) -> list of messages`; no bus, no clock, no loop."""
