"""The shape of a block of samples, checked in one place, and memory for the kernels."""

from typing import NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

_FLOAT = np.dtype(np.float64)


def as_block(block: ArrayLike, channels: int) -> NDArray[np.float64]:
    """Return a block as contiguous float64 of shape (n, channels).

    Parameters
    ----------
    block : array_like, shape (n,) or (n, channels)
        Samples, oldest first; (n,) only for one channel.
    channels : int
        Number of channels of the stream.
    """
    if type(block) is np.ndarray and block.dtype is _FLOAT and block.flags.carray:
        if block.ndim == 2 and block.shape[1] == channels:
            return block
    elif np.iscomplexobj(block):
        raise ValueError(f"block must be real, got {np.asarray(block).dtype}")
    samples = np.ascontiguousarray(block, dtype=np.float64)
    if not samples.flags.carray:  # read-only memory would be compiled for once more
        samples = samples.copy()
    if samples.ndim == 1 and channels == 1 and np.ndim(block) == 1:
        return samples.reshape(-1, 1)
    if samples.ndim != 2 or samples.shape[1] != channels:
        expected = f"(n, {channels})" if channels > 1 else "(n,) or (n, 1)"
        raise ValueError(f"block must be of shape {expected}, got {np.shape(block)}")
    return samples


def reject_non_finite(block: NDArray[np.float64], row: int, samples_seen: int) -> NoReturn:
    """Raise the error for a block whose first sample that is not finite stands in a given row.

    Parameters
    ----------
    block : ndarray, shape (n, channels)
        The offending block.
    row : int
        Row of the first sample that is not finite.
    samples_seen : int
        Samples of the stream before this block.
    """
    channel = int(np.flatnonzero(~np.isfinite(block[row]))[0])
    raise ValueError(
        f"block must be finite, got {block[row, channel]} at sample {samples_seen + row} of the stream"
        f" (sample {row} of the block, channel {channel})"
    )


def positive_integer(name: str, value: object) -> int:
    """Return an integer of at least one or say which argument is not.

    Parameters
    ----------
    name : str
        Name of the argument, for the message.
    value : object
        Its value.
    """
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise ValueError(f"{name} must be an integer >= 1, got {value!r}")
    return int(value)


def aligned(size: int) -> NDArray[np.float64]:
    """Return an array that begins at the start of a cache line, shape (size,).

    Parameters
    ----------
    size : int
        Numbers in it.
    """
    raw = np.empty(size + 8)
    skip = -raw.__array_interface__["data"][0] % 64 // 8
    return raw[skip : skip + size]
