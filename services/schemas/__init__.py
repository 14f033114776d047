"""What travels on the bus, for readers in any language: `antiphase.proto` and the JSON Schemas beside it."""
