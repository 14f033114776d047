"""Every message survives the wire to the bit, and no bytes whatever do harm."""

import ast
import math
import pathlib
import struct
import tomllib
import types
from typing import Literal, Union, get_args, get_origin

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from services.messages import (
    TOPICS,
    Event,
    Floats,
    ForceBlock,
    GuardState,
    ReportedLine,
    SampleBlock,
    TurretCommand,
)
from services.schemas import antiphase_pb2 as pb
from services.schemas.__main__ import compile_proto, json_schemas
from services.wire import DecodeError, decode, encode, encoding_of, key, topic_of

ROOT = pathlib.Path(__file__).resolve().parents[2]
KINDS = list(TOPICS.values())
INT64 = st.integers(-(2**63), 2**63 - 1)
FORMAT = ("version", "minor")
HEADER = {"run": "run", "source": "test", "sequence": 7, "cause": 6}


def fields(kind):
    return {field.name: field.type for field in msgspec.structs.fields(kind)}


BLOCKS = [kind for kind in KINDS if Floats in fields(kind).values()]
STATES = [kind for kind in KINDS if kind not in BLOCKS]


def values_of(annotation):
    """Everything that may travel in a field of a type."""
    if get_origin(annotation) is Literal:
        return st.sampled_from(get_args(annotation))
    if get_origin(annotation) in (Union, types.UnionType):
        return st.one_of(*(values_of(option) for option in get_args(annotation)))
    if get_origin(annotation) is tuple:
        return st.lists(values_of(get_args(annotation)[0]), max_size=3).map(tuple)
    if annotation is ReportedLine:
        return st.builds(ReportedLine, **{name: values_of(kind) for name, kind in fields(ReportedLine).items()})
    return {
        int: INT64,
        float: st.floats(allow_nan=False, allow_infinity=False),
        bool: st.booleans(),
        str: st.text(max_size=40),
        types.NoneType: st.none(),
    }[annotation]


@st.composite
def messages(draw, kinds=KINDS):
    kind = draw(st.sampled_from(kinds))
    samples = draw(st.integers(1, 5))
    special = arrays(np.float64, samples, elements=st.floats())
    drawn = {
        name: draw(special if annotation == Floats else values_of(annotation))
        for name, annotation in fields(kind).items()
        if name not in FORMAT
    }
    return kind(**drawn)


def bits(message):
    """The message as something that compares exactly: NaN equals NaN, 0.0 is not -0.0."""

    def plain(value):
        if isinstance(value, np.ndarray):
            return value.shape, value.tobytes()
        if isinstance(value, tuple):
            return tuple(plain(part) for part in value)
        if isinstance(value, ReportedLine):
            return tuple(plain(part) for part in msgspec.structs.astuple(value))
        return (type(value), value, math.copysign(1.0, value)) if isinstance(value, float) else (type(value), value)

    return type(message), {name: plain(getattr(message, name)) for name in fields(type(message))}


def example(kind):
    """A message of a type with a value in every field that differs from what absence reads as."""
    known = {"guard_state": "ACTIVE", "request": "arm", "action": "move"}
    line = ReportedLine(frequency_hz=652.2, amplitude_n=7.0, growth_1_per_s=30.0, kind="regenerative", confidence=0.9)
    plain = {
        int: 3, float: 2.5, bool: True, str: "x", float | None: 652.2, str | None: "regenerative", bool | None: True,
        tuple[str, ...]: ("clipped",), tuple[ReportedLine, ...]: (line, line),
    }  # fmt: skip
    given = {
        name: known[name] if name in known else np.arange(4.0) + number if annotation == Floats else plain[annotation]
        for number, (name, annotation) in enumerate(fields(kind).items())
        if name not in FORMAT
    }
    return kind(**given)


def proto(kind, **changes):
    """The protobuf message of an example, changed."""
    envelope = getattr(pb, kind.__name__).FromString(encode(example(kind)))
    for name, value in changes.items():
        if name == "channels":
            del envelope.channels[:]
            envelope.channels.extend(value)
        else:
            setattr(envelope, name, value)
    return envelope.SerializeToString()


@given(messages())
def test_round_trip_is_exact(message):
    assert bits(decode(type(message), encode(message))) == bits(message)


@pytest.mark.parametrize("kind", BLOCKS)
def test_arrays_come_back_contiguous_and_read_only_wherever_they_came_from(kind):
    message = example(kind)
    table = np.arange(100.0).reshape(10, 10)
    strided = {name: table[:, 3] for name, annotation in fields(kind).items() if annotation == Floats}
    back = decode(kind, encode(msgspec.structs.replace(message, **strided)))
    for name in strided:
        values = getattr(back, name)
        np.testing.assert_array_equal(values, table[:, 3])
        assert values.dtype == np.float64
        assert values.flags.c_contiguous
        assert values.flags.aligned
        assert not values.flags.writeable


def test_arrays_of_different_lengths_are_not_sent():
    message = example(ForceBlock)
    for force in (np.zeros(3), np.zeros((4, 2)), np.zeros((2, 2))):
        with pytest.raises(ValueError, match="one shape"):
            encode(msgspec.structs.replace(message, force_y1p_n=force))
    with pytest.raises(ValueError, match="one shape"):
        encode(msgspec.structs.replace(message, force_x1_n=np.zeros(0), force_y1p_n=np.zeros(0)))


def test_numbers_of_numpy_travel_as_numbers():
    event = msgspec.structs.replace(example(Event), sample=np.int64(12))
    assert decode(Event, encode(event)).sample == 12


@given(st.sampled_from(KINDS), st.binary(max_size=300))
def test_any_bytes_decode_or_raise_decode_error(kind, payload):
    try:
        decode(kind, payload)
    except DecodeError as error:
        said = str(error)
    else:
        said = kind.__name__
    assert said.startswith(kind.__name__)


@given(messages(), st.data())
def test_flipped_bits_and_bytes_decode_or_raise_decode_error(message, data):
    payload = bytearray(encode(message))
    for _ in range(data.draw(st.integers(1, 3))):
        payload[data.draw(st.integers(0, len(payload) - 1))] ^= data.draw(st.integers(1, 255))
    try:
        back = decode(type(message), bytes(payload))
    except DecodeError:
        return
    assert type(back) is type(message)
    encode(back)


@pytest.mark.parametrize("kind", KINDS)
def test_no_part_of_a_message_passes_for_the_whole(kind):
    payload = encode(example(kind))
    for end in range(len(payload)):
        with pytest.raises(DecodeError):
            decode(kind, payload[:end])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("other", KINDS)
def test_no_message_passes_for_another(kind, other):
    if kind is not other:
        with pytest.raises(DecodeError):
            decode(kind, encode(example(other)))


@pytest.mark.parametrize("kind", BLOCKS)
def test_a_block_that_lacks_a_field_is_refused(kind):
    needed = [name for name, annotation in fields(kind).items() if annotation != Floats and name != "minor"]
    for name in needed:
        envelope = getattr(pb, kind.__name__).FromString(encode(example(kind)))
        envelope.ClearField(name)
        with pytest.raises(DecodeError, match=name):
            decode(kind, envelope.SerializeToString())


@pytest.mark.parametrize(
    "changes",
    [
        {"samples_per_channel": 5},
        {"samples_per_channel": 0},
        {"samples_per_channel": 2**32 - 1},
        {"samples": b""},
        {"samples": b"\0" * 65},
        {"samples": b"", "channels": []},
        {"samples": b"", "channels": [], "samples_per_channel": 0},
        {"channels": ["force_x1_n"]},
        {"channels": ["force_x1_n", "force_x1_n"]},
        {"channels": ["force_x1_n", "force_y1p_n", "more"]},
        {"latency_s": math.nan},
        {"sample_rate_hz": math.inf},
    ],
)
def test_blocks_that_contradict_themselves_are_refused(changes):
    with pytest.raises(DecodeError):
        decode(ForceBlock, proto(ForceBlock, **changes))


def test_channels_are_found_by_name():
    samples = np.arange(12.0)
    payload = proto(ForceBlock, channels=["new", "force_y1p_n", "force_x1_n"], samples=samples.tobytes())
    block = decode(ForceBlock, payload)
    np.testing.assert_array_equal(block.force_y1p_n, samples[4:8])
    np.testing.assert_array_equal(block.force_x1_n, samples[8:])


def test_a_channel_appended_to_a_known_block_does_not_shift_the_others():
    head = encode(example(ForceBlock))
    with pytest.raises(DecodeError):
        decode(ForceBlock, head + pb.ForceBlock(channels=["more"]).SerializeToString())


@pytest.mark.parametrize("number", [0, 7, -1, 2**31 - 1])
def test_unknown_states_of_the_guard_are_refused(number):
    with pytest.raises(DecodeError, match="guard state"):
        decode(SampleBlock, proto(SampleBlock, guard_state=number))
    command = encode(example(TurretCommand)).replace(b'"move"', b'"jump"')
    with pytest.raises(DecodeError, match="jump"):
        decode(TurretCommand, command)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_command_that_is_no_number_reaches_nobody(value):
    payload = encode(msgspec.structs.replace(example(TurretCommand), shift_deg=value))
    with pytest.raises(DecodeError, match="shift_deg"):
        decode(TurretCommand, payload)


@pytest.mark.parametrize(
    "number", [b"NaN", b"Infinity", b"-Infinity", b"1e999", b'"2.5"', b"null", b"true", b"[" * 100_000]
)
def test_what_is_no_number_is_refused_in_json(number):
    payload = encode(example(TurretCommand)).replace(b"2.5", number)
    with pytest.raises(DecodeError):
        decode(TurretCommand, payload)
    with pytest.raises(DecodeError):
        decode(TurretCommand, payload.replace(b'"shift_deg"', b'"unknown"'))


@pytest.mark.parametrize("digits", [19, 30, 5000])
def test_integers_beyond_64_bits_are_refused(digits):
    payload = encode(example(TurretCommand)).replace(b'"order":3', b'"order":' + b"9" * digits)
    with pytest.raises(DecodeError):
        decode(TurretCommand, payload)


@pytest.mark.parametrize("text", [b"\xff\xfe", b"\\ud800", b"\\u12"])
def test_broken_text_is_refused_in_json(text):
    with pytest.raises(DecodeError):
        decode(Event, encode(example(Event)).replace(b'"text":"x"', b'"text":"' + text + b'"'))


def test_lengths_that_lie_and_payloads_without_end_are_refused():
    varint = b"\xff" * 9 + b"\x01"
    for tag in (b"\x52", b"\x42", b"\x12", b"\x0b", b"\x52\xff\xff\xff\xff\x07"):
        with pytest.raises(DecodeError):
            decode(SampleBlock, tag + varint)
    for kind, size in ((SampleBlock, (4 << 20) + 1), (Event, (1 << 18) + 1)):
        with pytest.raises(DecodeError, match=str(size)):
            decode(kind, b" " * size)
    with pytest.raises(DecodeError):
        decode(SampleBlock, b"\x0b" * 10_000)


def test_a_stranger_needs_nothing_but_the_proto():
    message = example(SampleBlock)
    block = pb.SampleBlock.FromString(encode(message))
    count = block.samples_per_channel
    assert count == 4
    for number, name in enumerate(block.channels):
        values = struct.unpack_from(f"<{count}d", block.samples, 8 * number * count)
        assert values == tuple(getattr(message, name))
    assert pb.GuardState.Name(block.guard_state) == "GUARD_STATE_ACTIVE"


def test_the_committed_module_is_what_the_proto_compiles_to():
    """Compares descriptors, not text: that depends on the version of the compiler."""
    tree = ast.parse(compile_proto())
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)]
    [described] = [ast.literal_eval(call.args[0]) for call in calls if call.func.attr == "AddSerializedFile"]
    assert described == pb.DESCRIPTOR.serialized_pb, "run python -m services.schemas"


def test_the_installed_protobuf_is_never_older_than_the_committed_module():
    text = (ROOT / "services/schemas/antiphase_pb2.py").read_text()
    made_by = text.split("# Protobuf Python Version: ")[1].split("\n")[0]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    [bound] = [line for line in project["dependencies"] if line.startswith("protobuf")]
    assert bound.split(",")[0] == f"protobuf>={made_by}"


@pytest.mark.parametrize("kind", BLOCKS)
def test_proto_and_message_type_have_the_same_fields(kind):
    described = {field.name: field for field in pb.DESCRIPTOR.message_types_by_name[kind.__name__].fields}
    layout = {"channels", "samples_per_channel", "samples"}
    plain = {name: annotation for name, annotation in fields(kind).items() if annotation != Floats}
    assert described.keys() - layout == plain.keys()
    cpp = {int: (2, 3), float: (5,), bool: (7,), str: (9,), GuardState: (8,)}
    for name, annotation in plain.items():
        field = described[name]
        assert field.cpp_type in (*cpp[annotation], *((3,) if name in FORMAT else ())), name
        assert field.has_presence, name
    assert {described[name].number for name in fields(kind) if name in described}.isdisjoint({8, 9, 10})


def test_guard_states_are_the_same_everywhere():
    names = {value.name.removeprefix("GUARD_STATE_") for value in pb.DESCRIPTOR.enum_types_by_name["GuardState"].values}
    assert names == {*get_args(GuardState), "UNSPECIFIED"}


def test_committed_json_schemas_are_those_of_the_messages():
    folder = ROOT / "services/schemas"
    assert {path.name: path.read_text() for path in folder.glob("*.json")} == json_schemas(), (
        "run python -m services.schemas"
    )
    assert set(json_schemas()) == {f"{kind.__name__}.json" for kind in STATES}


def test_keys_and_encodings():
    assert key("lathe-1", SampleBlock) == "antiphase/lathe-1/servo/turret1"
    assert [topic_of(kind) for kind in KINDS] == list(TOPICS)
    assert encoding_of(SampleBlock) == "application/protobuf;antiphase.SampleBlock"
    assert encoding_of(Event) == "application/json;antiphase.Event"
