"""Which versions of a message are read, and which are refused."""

import json

import msgspec
import pytest

from services.messages import FORMAT_MINOR, FORMAT_VERSION
from services.schemas import antiphase_pb2 as pb
from services.schemas.__main__ import json_schemas
from services.wire import DecodeError, decode, encode
from tests.services.test_wire import BLOCKS, FORMAT, KINDS, ROOT, STATES, bits, example


@pytest.mark.parametrize("version", [0, 2, 4_000_000_000])
@pytest.mark.parametrize("kind", KINDS)
def test_another_major_version_is_refused_naming_both(kind, version):
    payload = encode(msgspec.structs.replace(example(kind), version=version, minor=7))
    ours = rf"version {FORMAT_VERSION}\.{FORMAT_MINOR}"
    with pytest.raises(DecodeError, match=rf"{kind.__name__} is of format version {version}\.7, .* reads {ours}"):
        decode(kind, payload)


@pytest.mark.parametrize("kind", STATES)
def test_a_newer_minor_version_is_read_and_what_it_adds_is_ignored_in_json(kind):
    newer = msgspec.structs.replace(example(kind), minor=FORMAT_MINOR + 1)
    payload = encode(newer)[:-1] + b',"colour":{"of":["what","nobody",1,null]}}'
    assert bits(decode(kind, payload)) == bits(newer)


@pytest.mark.parametrize("kind", BLOCKS)
def test_a_newer_minor_version_is_read_and_what_it_adds_is_ignored_in_protobuf(kind):
    newer = msgspec.structs.replace(example(kind), minor=FORMAT_MINOR + 1)
    number, text, varint = 1000, 2, 0  # field 1000 as a string, field 1001 as a number: by the published wire format
    added = bytes([*_varint(number << 3 | text), 3, *b"new", *_varint((number + 1) << 3 | varint), 9])
    assert bits(decode(kind, encode(newer) + added)) == bits(newer)


def _varint(value):
    return [value & 0x7F | 0x80, value >> 7]


@pytest.mark.parametrize("kind", KINDS)
def test_a_message_without_a_minor_version_is_of_minor_version_0(kind):
    message = msgspec.structs.replace(example(kind), minor=0)
    if kind in BLOCKS:
        envelope = getattr(pb, kind.__name__).FromString(encode(message))
        envelope.ClearField("minor")
        payload = envelope.SerializeToString()
    else:
        payload = encode(message).replace(b'"minor":0,', b"")
        assert b"minor" not in payload
    assert bits(decode(kind, payload)) == bits(message)


@pytest.mark.parametrize("kind", STATES)
def test_a_state_of_version_1_0_is_read_without_the_fields_that_came_later(kind):
    whole = json.loads(encode(example(kind)))
    defaults = {field.name: field.default for field in msgspec.structs.fields(kind) if not field.required}
    later = {name: value for name, value in defaults.items() if name not in (*FORMAT, "cause")}
    told = {name: value for name, value in whole.items() if name not in (*later, "minor")}
    expected = msgspec.structs.replace(example(kind), minor=0, **later)
    assert bits(decode(kind, json.dumps(told).encode())) == bits(expected)


@pytest.mark.parametrize("kind", STATES)
def test_a_negative_minor_version_does_not_exist(kind):
    with pytest.raises(DecodeError, match=r"version 1\.-1, which does not exist"):
        decode(kind, encode(msgspec.structs.replace(example(kind), minor=-1)))


def test_the_published_schemas_tell_the_version():
    version = f"ormat version {FORMAT_VERSION}.{FORMAT_MINOR}"
    assert version in (ROOT / "services/schemas/antiphase.proto").read_text()
    assert all(version in text for text in json_schemas().values())


@pytest.mark.parametrize("kind", STATES)
def test_version_is_judged_before_the_rest(kind):
    with pytest.raises(DecodeError, match="version 9"):
        decode(kind, b'{"version": 9, "what": "nobody knows yet"}')
    with pytest.raises(DecodeError, match="version"):
        decode(kind, b'{"run": "a"}')
