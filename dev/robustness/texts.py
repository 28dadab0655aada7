"""Invalid values, and changes of valid texts and bytes."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

NUMBERS = (
    *(
        "0",
        "-0",
        "1",
        "-1",
        "1e-300",
        "1e300",
        "-1e300",
        "1e6",
        "999999",
        "1e9",
        "nan",
        "-nan",
        "inf",
        "-inf",
        "NaN(1)",
    ),
    *("", " ", "x", "1x", "0x10", "0x7fffffff", "1e", "1e+", ".", "--1", "1,5", "1_000", "9" * 5000, "0." + "0" * 3000),
    *("%s%n", "%p %p %p", "%99999999d", "${mass}", "$(optenv A 1)", "$(optenv A", "1\t2", "\u0661\u0662"),
)
NAMES = (
    *(
        "",
        " ",
        "world",
        "base",
        "a",
        "link0",
        "a" * 250,
        "a" * 251,
        "a" * 1023,
        "a" * 1100,
        "a" * 70_000,
        "\u00e4" * 200,
    ),
    *("%s%s%s%s", "%n", "%p", "%1000000000c", "../" * 300, "/dev/zero", "/proc/kmsg", "/proc/self/mem", "C:\\x", "-"),
    *("\u202e", "\U0001f600", "a\tb", "a b", "{rpbi}/x", "package://", "package://x", "model://", "file:///etc/passwd"),
)


def vector(random: Random, length: int = 3) -> str:
    """Returns an attribute of mostly good numbers, and mostly of that length."""
    count = length if random.random() < 0.99 else random.choice((0, 1, 2, 4, 1000))
    return " ".join(number(random) for _ in range(count))


def number(random: Random, share_of_bad: float = 0.004) -> str:
    """Returns a number, or a text that is not one."""
    return random.choice(NUMBERS) if random.random() < share_of_bad else f"{random.uniform(-1.0, 1.0):.6g}"


def positive(random: Random, share_of_bad: float = 0.004) -> str:
    """Returns a number above 0, or a text that is not one."""
    return random.choice(NUMBERS) if random.random() < share_of_bad else f"{random.uniform(0.01, 1.0):.6g}"


def name(random: Random, good: str, share_of_bad: float = 0.006) -> str:
    """Returns a name, or an invalid one."""
    return random.choice(NAMES) if random.random() < share_of_bad else good


def spoil(random: Random, data: bytes, most: int = 8) -> bytes:
    """Returns bytes with up to `most` changes, of single bits to whole parts."""
    changed = bytearray(data)
    for _ in range(random.choice((1, 1, 2, most))):
        if not changed:
            break
        random.choice(_CHANGES)(random, changed, random.randrange(len(changed)))
    return bytes(changed)


def _flip(random: Random, data: bytearray, at: int) -> None:
    data[at] ^= 1 << random.randrange(8)


def _overwrite(random: Random, data: bytearray, at: int) -> None:
    values = (
        b"\0",
        b"\xff\xff\xff\xff",
        b"\0\0\0\x80",
        b"\0\0\xc0\x7f",
        b"%n%n",
        b"<!--",
        b"]]>",
        b'"',
        b"\x7f\xff\xff\xff",
    )
    value = random.choice(values)
    data[at : at + len(value)] = value


def _drop(random: Random, data: bytearray, at: int) -> None:
    del data[at : at + random.choice((1, 2, 8, 64, 1000))]


def _repeat(random: Random, data: bytearray, at: int) -> None:
    data[at:at] = data[at : at + random.choice((1, 16, 200, 2000))] * random.choice((1, 1, 1, 20))


def _move(random: Random, data: bytearray, at: int) -> None:
    part = data[at : at + random.choice((4, 40, 400))]
    to = random.randrange(len(data))
    data[to:to] = part


def _cut(random: Random, data: bytearray, at: int) -> None:
    if random.random() < 0.2:
        del data[at:]


def _other_number(random: Random, data: bytearray, at: int) -> None:
    end = at
    while end < len(data) and data[end : end + 1] in b"0123456789.-+e":
        end += 1
    if end > at:
        data[at:end] = random.choice(NUMBERS).encode()


_CHANGES: tuple[Callable[[Random, bytearray, int], None], ...] = (
    *(_flip, _overwrite, _drop, _repeat, _move, _cut, _other_number, _other_number, _other_number),
)
