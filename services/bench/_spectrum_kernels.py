"""Plain loops that the sliding spectrum and its arithmetic are measured beside."""

from numba import njit

from chatter._simd import fma, load, memory, store


@njit(cache=True, fastmath=False)
def recursion(samples, ring, position, spectrum, twiddles, power):
    """Write the power of every bin after every sample by the textbook's recursion in complex128."""
    for i in range(samples.size):
        change = samples[i] - ring[position]
        ring[position] = samples[i]
        position += 1
        if position == ring.size:
            position = 0
        for k in range(spectrum.size):
            spectrum[k] = (spectrum[k] + change) * twiddles[k]
            power[i, k] = spectrum[k].real ** 2 + spectrum[k].imag ** 2
    return position


@njit(cache=True, fastmath=False)
def slide(samples, ring, spectrum, twiddles):
    """Run the same recursion over a long stream for the sake of its error alone; ring holds a window of zeros."""
    position = 0
    for i in range(samples.size):
        change = samples[i] - ring[position]
        ring[position] = samples[i]
        position += 1
        if position == ring.size:
            position = 0
        for k in range(spectrum.size):
            spectrum[k] = (spectrum[k] + change) * twiddles[k]


@njit(cache=True, fastmath=False)
def multiply_add(numbers, repeats):
    """Do eight independent products and sums of eight lanes in each turn: what the core can at most."""
    m = memory(numbers)
    x, y = load(m, 64), load(m, 72)
    a, b, c, d = load(m, 0), load(m, 8), load(m, 16), load(m, 24)
    e, f, g, h = load(m, 32), load(m, 40), load(m, 48), load(m, 56)
    for _ in range(repeats):
        a, b, c, d = fma(a, x, y), fma(b, x, y), fma(c, x, y), fma(d, x, y)
        e, f, g, h = fma(e, x, y), fma(f, x, y), fma(g, x, y), fma(h, x, y)
    for i, lanes in enumerate((a, b, c, d, e, f, g, h)):
        store(m, 8 * i, lanes)
