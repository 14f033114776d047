"""Write what is generated: `python -m services.schemas` after a change of `antiphase.proto` or `services.messages`."""

from __future__ import annotations

import json
import pathlib
import tempfile
from typing import Any

import msgspec

from services.messages import FORMAT_MINOR, FORMAT_VERSION, TOPICS, Message
from services.wire import encoding_of

FOLDER = pathlib.Path(__file__).resolve().parent
PROTO, MODULE = "antiphase.proto", "antiphase_pb2.py"


def compile_proto(folder: pathlib.Path = FOLDER) -> str:
    """Return the source of the module that `protoc` makes of `antiphase.proto`; needs `grpcio-tools`."""
    import grpc_tools
    from grpc_tools import protoc

    include = pathlib.Path(str(grpc_tools.__file__)).parent / "_proto"
    with tempfile.TemporaryDirectory() as out:
        failed: int = protoc.main(["protoc", f"-I{folder}", f"-I{include}", f"--python_out={out}", PROTO])
        if failed:
            raise ValueError(f"{PROTO} must compile, protoc said {failed}")
        return (pathlib.Path(out) / MODULE).read_text(encoding="utf-8")


def json_schemas() -> dict[str, str]:
    """Return the text of each JSON Schema by the name of its file."""
    kinds = [kind for kind in TOPICS.values() if encoding_of(kind).startswith("application/json")]
    return {f"{kind.__name__}.json": json.dumps(_schema(kind), indent=2) + "\n" for kind in kinds}


def _schema(kind: type[Message]) -> dict[str, Any]:
    """Return the schema of one type; its version is fixed and must be there, and enumerations say their type."""
    parts: dict[str, Any] = msgspec.json.schema(kind)["$defs"]
    schema: dict[str, Any] = _whole(parts[kind.__name__], parts)
    schema["properties"]["version"] = {"type": "integer", "const": FORMAT_VERSION}
    schema["properties"]["minor"] = {"type": "integer", "minimum": 0, "default": 0}
    for rule in schema["properties"].values():
        if "enum" in rule:
            rule["type"] = "string"
    schema["required"] = ["version", *schema["required"]]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": f"antiphase.{kind.__name__}",
            "$comment": f"format version {FORMAT_VERSION}.{FORMAT_MINOR}; a newer minor version only adds properties",
            **schema}  # fmt: skip


def _whole(rule: Any, parts: dict[str, Any]) -> Any:
    """Put parts that are referred to in their places: viewers do not follow references."""
    if isinstance(rule, dict):
        named = rule.get("$ref")
        if named:
            return _whole(parts[named.rsplit("/", 1)[-1]], parts)
        return {key: _whole(value, parts) for key, value in rule.items()}
    return [_whole(item, parts) for item in rule] if isinstance(rule, list) else rule


def main() -> None:
    """Write the module and the JSON Schemas beside the `.proto`."""
    for name, text in {MODULE: compile_proto(), **json_schemas()}.items():
        (FOLDER / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
