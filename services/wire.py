"""Messages as bytes: blocks of samples as protobuf, everything else as JSON.

The arrays of a block travel in one field of little-endian float64, channel after channel, with the names of the
channels beside it: an array field that a message type gains in `services.messages` travels without a change here or
in `antiphase.proto`. Samples may be NaN or infinite (a sensor that failed); other numbers must be finite. JSON cannot
say NaN: a number that is not finite goes out as `null`, which reads as None where the type allows None and is a
`DecodeError` where it does not. So a `TurretCommand` with `shift_deg` NaN reaches no machine.

Fields and channels that the receiver does not know are ignored; what it needs and does not find is an error. So a
message of a newer minor version is read as far as it is known, and one without a minor version is of minor version 0.
"""

from __future__ import annotations

import math
from operator import attrgetter, itemgetter
from typing import Any, Protocol, TypeVar, get_args

import google.protobuf.message
import msgspec
import numpy as np

from services.messages import FORMAT_MINOR, FORMAT_VERSION, TOPICS, Floats, GuardState, Message
from services.schemas import antiphase_pb2

pb: Any = antiphase_pb2
M = TypeVar("M", bound=Message)
LITTLE = np.dtype("<f8")
MOST_BYTES = 4 << 20
"""Longest payload that is looked at: more than five seconds of the longest block."""
MOST_JSON_BYTES = 1 << 18
INT64 = range(-(2**63), 2**63)
_LATER = "minor"
"""Field that a block of minor version 0 lacks."""
GUARD_STATES: dict[int, str] = {pb.GuardState.Value(f"GUARD_STATE_{name}"): name for name in get_args(GuardState)}
GUARD_NUMBERS = {name: number for number, name in GUARD_STATES.items()}


class DecodeError(ValueError):
    """A payload is not the message that it should be; says what is wrong with it."""


class _Codec(Protocol):
    """Both ways for one type of message."""

    encoding: str

    def encode(self, message: Any) -> bytes:
        """Return the payload."""
        ...

    def decode(self, payload: bytes) -> Any:
        """Return the message, or raise `DecodeError`."""
        ...


class _Header(msgspec.Struct):
    version: int
    minor: int = 0


class _JsonCodec:
    """Structs without arrays; the version is looked at before anything else."""

    def __init__(self, kind: type[Message]) -> None:
        self.encoding = f"application/json;antiphase.{kind.__name__}"
        self._name = kind.__name__
        self._encoder = msgspec.json.Encoder(enc_hook=_plain)
        self._header = msgspec.json.Decoder(_Header)
        self._decoder = msgspec.json.Decoder(kind)
        self._integers = attrgetter(*(f.name for f in msgspec.structs.fields(kind) if f.type is int))

    def encode(self, message: Any) -> bytes:
        return self._encoder.encode(message)

    def decode(self, payload: bytes) -> Any:
        if len(payload) > MOST_JSON_BYTES:
            raise DecodeError(f"{self._name} has {len(payload)} bytes, at most {MOST_JSON_BYTES} are read")
        try:
            header = self._header.decode(payload)
            _check_version(self._name, header.version, header.minor)
            message = self._decoder.decode(payload)
        except DecodeError:
            raise
        except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
            raise DecodeError(f"{self._name} cannot be read: {error}") from error
        if not all(number in INT64 for number in self._integers(message)):
            raise DecodeError(f"{self._name} holds an integer of more than 64 bits")
        return message if message.minor == header.minor else msgspec.structs.replace(message, minor=header.minor)


class _BlockCodec:
    """Structs with arrays; what is an array, a float, the state of the guard or plain follows from the struct."""

    def __init__(self, kind: type[Message], envelope: Any) -> None:
        self.encoding = f"application/protobuf;antiphase.{kind.__name__}"
        self._kind, self._envelope, self._name = kind, envelope, kind.__name__
        fields = msgspec.structs.fields(kind)
        self._channels = tuple(f.name for f in fields if f.type == Floats)
        self._guarded = any(f.type == GuardState for f in fields)
        self._plain = tuple(f.name for f in fields if f.type not in (Floats, GuardState))
        self._names = (*self._plain, *self._channels)
        self._rest = tuple(name for name in self._plain if name != _LATER)
        self._needed = (*self._rest, *(("guard_state",) if self._guarded else ()))
        self._of_arrays, self._of_plain = attrgetter(*self._channels), attrgetter(*self._plain)
        self._of_rest = attrgetter(*self._rest)
        floats = [self._plain.index(f.name) for f in fields if f.type is float]
        self._floats = itemgetter(*floats, *floats[:1])  # one twice, so that the answer is a tuple in any case
        self._head = self._begin(FORMAT_MINOR)

    def _begin(self, minor: int) -> bytes:
        """Return what a block begins with: the minor version must not end it, where a cut would not be noticed."""
        return self._envelope(channels=self._channels, minor=minor).SerializeToString()

    def encode(self, message: Any) -> bytes:
        arrays = self._of_arrays(message)
        try:
            table: Floats = np.array(arrays, LITTLE)
        except ValueError:
            table = np.zeros(0)
        if table.ndim != 2 or not table.size:
            shapes = sorted({array.shape for array in arrays})
            raise ValueError(f"arrays of a {self._name} must all have one shape (n,), n > 0, got {shapes}")
        envelope = self._envelope(
            samples_per_channel=table.size // len(arrays),
            samples=table.tobytes(),
            **dict(zip(self._rest, self._of_rest(message), strict=True)),
        )
        if self._guarded:
            envelope.guard_state = GUARD_NUMBERS[message.guard_state]
        head = self._head if message.minor == FORMAT_MINOR else self._begin(message.minor)
        return head + envelope.SerializeToString()

    def decode(self, payload: bytes) -> Any:
        if len(payload) > MOST_BYTES:
            raise DecodeError(f"{self._name} has {len(payload)} bytes, at most {MOST_BYTES} are read")
        try:
            envelope = self._envelope.FromString(payload)
        except google.protobuf.message.DecodeError as error:
            raise DecodeError(f"{self._name} cannot be read: {error}") from error
        _check_version(self._name, envelope.version, envelope.minor)
        if not all(map(envelope.HasField, self._needed)):
            raise DecodeError(f"{self._name} lacks {next(n for n in self._needed if not envelope.HasField(n))}")
        plain = self._of_plain(envelope)
        if not all(map(math.isfinite, self._floats(plain))):
            raise DecodeError(f"{self._name} holds a number that is not finite outside of its samples")
        channels, count, samples = envelope.channels, envelope.samples_per_channel, envelope.samples
        if not count or len(samples) != LITTLE.itemsize * count * len(channels):
            raise DecodeError(
                f"{self._name} has {len(samples)} bytes of samples for {len(channels)} channels of {count} samples"
            )
        rows = np.frombuffer(samples, LITTLE).reshape(-1, count)
        if len(channels) != len(self._channels) or not payload.startswith(self._head):
            rows = self._sorted(tuple(channels), rows)
        values: dict[str, Any] = dict(zip(self._names, (*plain, *rows), strict=True))
        if self._guarded:
            values["guard_state"] = GUARD_STATES.get(envelope.guard_state)
            if values["guard_state"] is None:
                raise DecodeError(f"{self._name} names guard state {envelope.guard_state}, which does not exist")
        return self._kind(**values)

    def _sorted(self, names: tuple[str, ...], rows: Floats) -> list[Floats]:
        """Return the channels of a block that another program put together, wherever they are in it."""
        found = dict(zip(names, rows, strict=True))
        if len(found) != len(names):
            raise DecodeError(f"{self._name} has the same channel twice: {', '.join(names):.400}")
        if lacking := [name for name in self._channels if name not in found]:
            raise DecodeError(f"{self._name} lacks channel {', '.join(lacking)}")
        return [found[name] for name in self._channels]


def _plain(value: object) -> object:
    """Give msgspec the Python number in a NumPy one."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"a message must hold plain values, got {type(value).__name__}")


def _check_version(name: str, version: int, minor: int) -> None:
    if version != FORMAT_VERSION:
        raise DecodeError(
            f"{name} is of format version {version}.{minor}, this program reads version "
            f"{FORMAT_VERSION}.{FORMAT_MINOR} and every other {FORMAT_VERSION}.x"
        )
    if minor < 0:
        raise DecodeError(f"{name} is of format version {version}.{minor}, which does not exist")


def _codec(kind: type[Message]) -> _Codec:
    holds_arrays = any(field.type == Floats for field in msgspec.structs.fields(kind))
    return _BlockCodec(kind, getattr(pb, kind.__name__)) if holds_arrays else _JsonCodec(kind)


_CODECS = {kind: _codec(kind) for kind in TOPICS.values()}
_TOPIC_OF = {kind: topic for topic, kind in TOPICS.items()}


def encode(message: Message) -> bytes:
    """Return the payload of a message.

    Raises
    ------
    ValueError, TypeError
        If the message breaks its own type: arrays of different lengths, integers of more than 64 bits.
    """
    return _CODECS[type(message)].encode(message)


def decode(kind: type[M], payload: bytes) -> M:
    """Return the message of a type that a payload holds; its arrays are read-only.

    Parameters
    ----------
    kind
        Type of message that travels on the topic.
    payload
        Any bytes.

    Raises
    ------
    DecodeError
        Whatever is wrong with the bytes.
    """
    return _CODECS[kind].decode(payload)


def encoding_of(kind: type[Message]) -> str:
    """Return the encoding that goes with the payloads of a type: media type and name of the schema."""
    return _CODECS[kind].encoding


def topic_of(kind: type[Message]) -> str:
    """Return the topic on which a type travels."""
    return _TOPIC_OF[kind]


def key(machine: str, kind: type[Message]) -> str:
    """Return the zenoh key of a type of message of a machine."""
    return f"antiphase/{machine}/{_TOPIC_OF[kind]}"
