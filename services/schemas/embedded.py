"""The schemas as a recording embeds them, so that Foxglove, PlotJuggler and others can open it."""

from __future__ import annotations

import importlib.resources
import json
from typing import Any

from google.protobuf.descriptor_pb2 import FileDescriptorSet

from services.schemas import antiphase_pb2


def schema_of(name: str) -> tuple[str, bytes] | None:
    """Return encoding and data of the schema `antiphase.<type>` as MCAP wants them, None for one not known."""
    package, _, kind = name.partition(".")
    descriptor: Any = antiphase_pb2.DESCRIPTOR
    if package != descriptor.package:
        return None
    if kind in descriptor.message_types_by_name:
        described = FileDescriptorSet()
        descriptor.CopyToProto(described.file.add())
        return "protobuf", described.SerializeToString()
    file = importlib.resources.files("services.schemas") / f"{kind}.json"
    if not kind.isidentifier() or not file.is_file():
        return None
    return "jsonschema", json.dumps(_for_viewers(json.loads(file.read_text(encoding="utf-8")))).encode()


def _for_viewers(schema: dict[str, Any]) -> dict[str, Any]:
    """Give each property one type: Foxglove refuses a schema with alternatives, so null is left out of them."""
    properties = schema["properties"]
    for name, rule in properties.items():
        if "anyOf" in rule:
            properties[name] = next(option for option in rule["anyOf"] if option["type"] != "null")
    return schema
