"""Sound as telephones and recorders store it: FLAC, MP3, OGG, AIFF, AU and compressed WAV, read by libsndfile."""

from __future__ import annotations

import pathlib
from collections.abc import Sequence
from typing import Any

from services.errors import InputError
from services.importers.recording import Recording
from services.importers.room import CHUNK_ROWS, Growing, watched, whole_share
from services.messages import Floats

_HEADS = (b"fLaC", b"OggS\0", b"ID3\2", b"ID3\3", b"ID3\4", b".snd\0", b"caff\0", b"riff\x2e\x91")
"""Long enough that no text begins so: a table may well have a first column `ID3` or `FORM`."""
_ROWS = 1 << 10
"""Rows that are decoded at once: so many are lost where a file is damaged."""
_UNKNOWN = 1 << 48
"""Rows from which on a header does not know how many follow, as of a stream that was never closed."""
_LOSSY = ("MP3", "OGG", "MPEG", "VORBIS", "OPUS")


def is_audio(head: bytes) -> bool:
    """Whether a file with this beginning is sound that `read_audio` knows.

    Parameters
    ----------
    head
        Its first bytes.
    """
    layer3 = len(head) > 1 and head[0] == 0xFF and head[1] & 0xE6 == 0xE2  # MPEG audio without a tag before it
    aiff = head.startswith(b"FORM") and head[8:12] in (b"AIFF", b"AIFC")
    return head.startswith(_HEADS) or aiff or layer3


def read_audio(path: pathlib.Path) -> Recording:
    """Read `path`, scaled to +-1 full scale; what a lossy format leaves out is said in a note.

    Parameters
    ----------
    path
        FLAC, MP3, OGG, AIFF, AU, CAF, W64 or WAV file.
    """
    import soundfile

    try:
        with soundfile.SoundFile(path) as file:
            kinds, announced, rate = f"{file.format} {file.subtype}".upper(), file.frames, float(file.samplerate)
            lossy = any(kind in kinds for kind in _LOSSY)
            cut = "(should be" in file.extra_info  # so libsndfile marks a header that announces more than is there
            samples = _read(file, announced if lossy else _ROWS)
    except (soundfile.LibsndfileError, RuntimeError, ValueError, MemoryError) as error:
        raise InputError("file", str(path), f"a readable sound file ({_said(error)})") from error
    if rate <= 0 or samples.size == 0:
        raise InputError("file", str(path), f"a sound file with samples and a rate ({samples.size}, {rate:g} Hz)")
    notes: list[str] = []
    missing = announced - len(samples) if announced < _UNKNOWN else 0
    if cut or missing > (rate if lossy else 0):  # a lossy header counts what its coder added at both ends
        notes.append(f"the file ends early: {len(samples) / rate:.2f} s are there, its header announces more")
    if announced >= _UNKNOWN:
        notes.append(f"the header does not tell the length: up to {_ROWS / rate:.2g} s may be missing at the end")
    if lossy:
        notes.append("stored with loss: levels, and all above some 15 kHz, are not those of the microphone")
    return sound(path, rate, samples, notes)


def _read(file: Any, rows: int) -> Floats:
    """Return the samples up to the end or to where they are damaged; lossy formats only bear one reading, in order."""
    whole = Growing(file.channels)
    done, left = 0, file.frames
    with watched("samples", max(left if left < _UNKNOWN else 1, 1), CHUNK_ROWS) as advance:
        while left:
            try:
                part = file.read(min(rows, left), dtype="float64", always_2d=True)
            except RuntimeError:
                if not done:
                    raise
                break
            if not len(part):
                break
            whole.append(part)
            done, left = done + len(part), left - len(part)
            advance(len(part))
    return whole.whole()


def _said(error: Exception) -> str:
    """Return what libsndfile says, without the path, which stands in the message already."""
    return str(getattr(error, "error_string", error)).strip().rstrip(".")


def sound(path: pathlib.Path, rate_hz: float, samples: Floats, notes: Sequence[str]) -> Recording:
    """Return sound as a recording, its channels named as recorders call them.

    Parameters
    ----------
    path
        Where it is from.
    rate_hz
        Sampling rate (Hz).
    samples
        Of each channel, shape (n, channels); 1 is full scale.
    notes
        What a reader should know about it.
    """
    missing = whole_share(samples)
    gaps = [f"{missing} of {len(samples)} samples are not finite numbers and count as gaps"] if missing else []
    count = samples.shape[1]
    names = {1: ("mono",), 2: ("left", "right")}.get(count, tuple(f"ch{k}" for k in range(count)))
    return Recording(
        source=str(path), rate_hz=rate_hz, names=names, units=("full scale",) * count, samples=samples,
        notes=(*notes, *gaps),
    )  # fmt: skip
