"""Foreign file formats to one `Recording` type."""
