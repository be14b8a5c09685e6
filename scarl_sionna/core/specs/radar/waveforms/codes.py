"""Phase codes of radars, as complex chips of magnitude 1, and what their periodic autocorrelation is."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

Complex = npt.NDArray[np.complex128]

_TAPS = {
    2: (1,), 3: (2,), 4: (3,), 5: (3,), 6: (5,), 7: (6,), 8: (7, 6, 1), 9: (5,), 10: (7,), 11: (9,),
    12: (11, 10, 4), 13: (12, 11, 8), 14: (13, 12, 2), 15: (14,), 16: (15, 13, 4),
}  # fmt: skip # a table
"""Of a primitive polynomial by its number of bits: which of the values before a chip it is made of, as
`scipy.signal.max_len_seq` has them. That package takes every command a second of CPU time to import."""


def m_sequence(length: int) -> Complex:
    """Return a maximum-length sequence of 2**n - 1 chips of +-1; its autocorrelation is -1 at every other shift.

    References
    ----------
    .. [1] S. W. Golomb, *Shift Register Sequences*, Holden-Day, 1967.
    """
    bits = _order(length, "2**n - 1 with n from 2 to 16", 1)
    chips = [1] * bits  # a chip follows from those at most `bits` before it
    for now in range(length - bits):
        chips.append(chips[now] ^ sum(chips[now + tap] for tap in _TAPS[bits]) % 2)
    return np.asarray(1.0 - 2.0 * np.array(chips[:length], dtype=np.float64), dtype=np.complex128)


def gold(length: int, index: int) -> Complex:
    """Return one of the Gold codes of 2**n - 1 chips, n not a multiple of 4: autocorrelation of three values.

    The largest is ``2**((n + 2) // 2) + 1``. It is the product of an m-sequence and its decimation by ``2**k + 1``,
    shifted by `index`.

    References
    ----------
    .. [1] R. Gold, "Optimal binary sequences for spread spectrum multiplexing", IEEE Trans. Inf. Theory 13(4), 1967.
    """
    bits = _order(length, "2**n - 1 with n from 5 to 16, not a multiple of 4", 1)
    if bits % 4 == 0 or bits < 5:
        raise ValueError(f"code_length: 2**n - 1 with n from 5 to 16, not a multiple of 4; {length} has n = {bits}")
    step = 3 if bits % 2 else 2 ** ((bits + 2) // 2) + 1
    first = m_sequence(length)
    second = first[np.arange(length) * step % length]
    return first * np.roll(second, -index)


def zadoff_chu(length: int, root: int) -> Complex:
    """Return the Zadoff-Chu sequence of a root coprime to the length; its autocorrelation is 0 at every other shift.

    References
    ----------
    .. [1] D. C. Chu, "Polyphase codes with good periodic correlation properties", IEEE Trans. Inf. Theory 18(4), 1972.
    """
    if np.gcd(length, root) != 1:
        raise ValueError(f"code_index: coprime to the code's length of {length}; {root} is not")
    chip = np.arange(length)
    half_turns = (root * chip * (chip + length % 2)) % (2 * length)
    return np.asarray(np.exp(-1j * np.pi * half_turns / length))


def golay(length: int) -> tuple[Complex, Complex]:
    """Return a pair of 2**n chips of +-1 whose autocorrelations sum to 0 at every other shift.

    References
    ----------
    .. [1] M. J. E. Golay, "Complementary series", IRE Trans. Inf. Theory 7(2), 1961.
    """
    first = second = np.ones(1, dtype=np.complex128)
    for _ in range(_order(length, "2**n with n from 1 to 16", 0)):
        first, second = np.concatenate([first, second]), np.concatenate([first, -second])
    return first, second


@lru_cache(maxsize=8)
def _apas(length: int) -> tuple[float, ...]:
    prime = length // 2 - 1
    if length % 2 or prime < 3 or any(prime % factor == 0 for factor in range(2, int(prime**0.5) + 1)):
        raise ValueError(
            f"code_length: 2 (p + 1) with an odd prime p (8, 12, 16, 24, ..., 1020, 2044); {length} is not"
        )
    square = {value * value % prime for value in range(1, prime)}
    other = next(value for value in range(2, prime) if value not in square)

    def times(a: tuple[int, int], b: tuple[int, int]) -> tuple[int, int]:  # in GF(p**2) = GF(p)[sqrt(other)]
        return (a[0] * b[0] + other * a[1] * b[1]) % prime, (a[0] * b[1] + a[1] * b[0]) % prime

    def power(a: tuple[int, int], exponent: int) -> tuple[int, int]:
        out = (1, 0)
        while exponent:
            if exponent & 1:
                out = times(out, a)
            a, exponent = times(a, a), exponent >> 1
        return out

    size = prime * prime - 1
    factors = [n for n in range(2, prime + 2) if size % n == 0 and all(n % d for d in range(2, int(n**0.5) + 1))]
    candidates = ((value, 1) for value in range(prime))
    root = next(a for a in candidates if all(power(a, size // n) != (1, 0) for n in factors))
    chips, element = [], (0, 1)  # the trace of sqrt(other) is 0: the zero of the series comes first
    for _ in range(length):
        trace = 2 * element[0] % prime
        chips.append(1.0 if trace == 0 or trace in square else -1.0)
        element = times(element, root)
    return tuple(chips)


def almost_perfect(length: int) -> Complex:
    """Return an almost perfect autocorrelation sequence (APAS) of 2 (p + 1) chips of +-1, p an odd prime.

    The autocorrelation is 0 at every shift but that of half the length, where it is ``4 - length``. The signs are the
    quadratic characters of the traces of a primitive element's powers in GF(p**2); of the two zeros both become +1.

    References
    ----------
    .. [1] J. Wolfmann, "Almost perfect autocorrelation sequences", IEEE Trans. Inf. Theory 38(4), 1992.
    """
    return np.asarray(_apas(length), dtype=np.complex128)


def _order(length: int, allowed: str, less: int) -> int:
    """Return n of a length of ``2**n - less``."""
    bits = (length + less).bit_length() - 1
    if length + less != 1 << bits or not 1 + less <= bits <= 16:
        raise ValueError(f"code_length: {allowed}; {length} is not")
    return bits


def chips_of(code: str, length: int, index: int, phases_deg: tuple[float, ...] | None) -> Complex:
    """Return the chips of a code by its name, shape (num_codes, length); two of ``"golay"`` take turns.

    Raises
    ------
    ValueError
        If there is no such code of that length, or own phases stand without the name ``"own"``.
    """
    if (code == "own") != (phases_deg is not None):
        raise ValueError("code = 'own' with code_phases_deg, and only with them")
    if phases_deg is not None:
        if len(phases_deg) != length:
            raise ValueError(f"code_phases_deg: {length}, one a chip; there are {len(phases_deg)}")
        return np.asarray(np.exp(1j * np.deg2rad(np.asarray(phases_deg))))[None]
    if code == "golay":
        return np.stack(golay(length))
    if code == "gold":
        return gold(length, index)[None]
    if code == "zadoff_chu":
        return zadoff_chu(length, index)[None]
    return (m_sequence(length) if code == "m_sequence" else almost_perfect(length))[None]
