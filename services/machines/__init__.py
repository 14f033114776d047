"""Machines at the end of the bus: the contract that each adapter keeps, its test, and the adapters there are."""
