"""What a benchmark sends must be what the loop sends; the speeds themselves are no test."""

from services.bench.transport import _sizes, sample_block
from services.messages import SampleBlock
from services.wire import decode, encode


def test_the_block_of_the_benchmark_travels():
    block = sample_block(7)
    assert decode(SampleBlock, encode(block)).sequence == 7


def test_the_bare_round_trip_carries_as_many_bytes():
    assert all(size > 100 for size in _sizes())
