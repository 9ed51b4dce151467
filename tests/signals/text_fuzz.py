"""Text files by mutation of good ones: read or refused in one line, and no number other than what stands in the file.

python -m tests.signals.text_fuzz 5000      so many files; seeds count from 0
"""

from __future__ import annotations

import csv
import re
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from limb_nodes.errors import UserError
from limb_nodes.signals.recording import Recording, read_recording

LONGEST = 2.0
MOST_MEMORY = 500 * 1024  # KiB
ROWS = 60
TOKENS = [
    b",", b";", b"\t", b" ", b"\n", b"\r\n", b"\r", b'"', b"'", b"\0", b"#", b"%", b"nan", b"inf", b"-", b".", b"e5",
    b"1e999", b"1_0", b"0x10", b"True", b"\xef\xbb\xbf", b"\xff\xfe", b"\xb5", "µ".encode(), "٣".encode(), b"7.5V",
    b"[mV]", b"(s)", b"time", b"999999999999999999999", b"sep=;\n", b"endheader\n", b"\n\n", b"1,234", b"00", b"+",
]  # fmt: skip


def _rows(row: Callable[[int, float, float, float], str]) -> str:
    random = np.random.default_rng(0)
    signal = np.round(random.normal(size=(ROWS, 2)), 4)
    return "".join(row(k, k / 1000, a, b) + "\n" for k, (a, b) in enumerate(signal.tolist()))


def _comma(text: str) -> str:
    return text.replace(".", ",")


GOOD = {
    "plain": "time [s],RF [mV],BF [mV]\n" + _rows(lambda k, t, a, b: f"{t:.3f},{a},{b}"),
    "semicolon": "Zeit (s);RF (mV);BF (mV)\n" + _comma(_rows(lambda k, t, a, b: f"{t:.3f};{a};{b}")),
    "sep": "sep=;\ntime;RF;BF\n" + _comma(_rows(lambda k, t, a, b: f"{t:.3f};{a:.4f};{b:.4f}")),
    "tabs": "# made\ntime\tRF\tBF\n" + _rows(lambda k, t, a, b: f"{t:.3f}\t{a}\t{b}"),
    "blanks": "time RF BF\n" + _rows(lambda k, t, a, b: f"{t:8.3f} {a:9.4f} {b:9.4f}"),
    "units": 'Time,"RF, left",BF,\ns,uV,uV,\n' + _rows(lambda k, t, a, b: f"{t:.3f},{a},{b},"),
    "storage": "EMG\nversion=1\nnRows=60\nnColumns=3\nendheader\ntime\tRF\tBF\n"
    + _rows(lambda k, t, a, b: f"{t:.8f}\t{a:.8f}\t{b:.8f}"),
    "noraxon": "type,frequency,count\nrecord,1000,60\n\ntime,Activity,Marker,RF (uV),BF (uV)\n"
    + _rows(lambda k, t, a, b: f"{t:.5f},{'REST' if k == 0 else ''},,{a},{b}"),
    "openbci": "%OpenBCI Raw EXG Data\n%Sample Rate = 250 Hz\nSample Index, EXG 0, EXG 1, Accel Channel 0, Timestamp\n"
    + _rows(lambda k, t, a, b: f"{k % 256}, {a}, {b}, 0.02, {1772460000 + k // 12 * 0.048:.6f}"),
    "opensignals": '# OpenSignals\n# {"a": {"column": ["nSeq", "DI", "CH1", "CH2"], "sampling rate": 1000}}\n'
    "# EndOfHeader\n" + _rows(lambda k, t, a, b: f"{k % 16}\t0\t{32768 + round(1e3 * a)}\t{32768 + round(1e3 * b)}\t"),
    "delsys": "Application:,x\nS 1,,,,S 2,\nEMG 1 Time Series (s),EMG 1 (mV),ACC Time Series (s),ACC X (G),EMG 1 Time "
    "Series (s),EMG 1 (mV)\n,1000 Hz,,100 Hz,,1000 Hz\n"
    + _rows(lambda k, t, a, b: f"{t:.6f},{a},{k / 100 if k < 6 else ''},{0.1 if k < 6 else ''},{t:.6f},{b}"),
    "channels": "".join(
        f"Channel {i}: '{name}', 60 values, engineering units: mV, no filters from 50 to 1000 samples per second.\n"
        for i, name in enumerate(("RF", "BF"), 1)
    )
    + "\n"
    + _rows(lambda k, t, a, b: f"{a}\t{b}"),
    "vicon": "Devices\n1000\n,,EMG,EMG\nFrame,Sub Frame,RF,BF\n,,V,V\n"
    + _rows(lambda k, t, a, b: f"{k // 10},{k % 10},{a},{b}")
    + "\nTrajectories\n100\nFrame,Sub Frame,X\n,,mm\n1,0,5\n2,0,6\n",
}


def mutated(seed: int) -> bytes:
    """A good file, changed in one to five places."""
    random = np.random.default_rng(seed)
    names = list(GOOD)
    content = GOOD[names[seed % len(names)]].encode()
    for _ in range(random.integers(1, 6)):
        content = CHANGES[random.integers(len(CHANGES))](content, random)
    return content


def _at(content: bytes, random: np.random.Generator) -> int:
    # The header is short, and worth as much as the rows.
    return int(random.integers(min(len(content), 200 if random.random() < 0.5 else 10**9) + 1))


def _flip(content: bytes, random: np.random.Generator) -> bytes:
    at = _at(content, random)
    return content[:at] + bytes([random.integers(256)]) + content[at + 1 :]


def _insert(content: bytes, random: np.random.Generator) -> bytes:
    at = _at(content, random)
    return content[:at] + TOKENS[random.integers(len(TOKENS))] + content[at:]


def _cut_out(content: bytes, random: np.random.Generator) -> bytes:
    at = _at(content, random)
    return content[:at] + content[at + int(random.integers(1, 30)) :]


def _cut_off(content: bytes, random: np.random.Generator) -> bytes:
    return content[: _at(content, random)]


def _line(content: bytes, random: np.random.Generator) -> bytes:
    lines = content.split(b"\n")
    one, two = random.integers(len(lines), size=2)
    how = random.integers(3)
    if how == 0:
        lines[one], lines[two] = lines[two], lines[one]
    elif how == 1:
        lines.insert(one, lines[two])
    else:
        del lines[one]
    return b"\n".join(lines)


def _exchange(content: bytes, random: np.random.Generator) -> bytes:
    signs = [b",", b";", b"\t", b" ", b".", b"\n", b"\r\n"]
    one, two = signs[random.integers(7)], signs[random.integers(7)]
    return content.replace(one, two, int(random.choice([1, 5, -1])))


def _repeat(content: bytes, random: np.random.Generator) -> bytes:
    at = _at(content, random)
    return content[:at] + content[at : at + 20] * int(random.choice([2, 50, 5000])) + content[at:]


def _encode(content: bytes, random: np.random.Generator) -> bytes:
    encoding = ["utf-16", "utf-16-le", "latin-1", "utf-8-sig", "utf-32"][random.integers(5)]
    return content.decode("latin-1").encode(encoding)


CHANGES = [_flip, _flip, _insert, _insert, _insert, _cut_out, _cut_off, _line, _line, _exchange, _repeat, _encode]


def wrong_numbers(recording: Recording, content: bytes) -> list[str]:
    """The channels whose values do not stand one below the other in any column of the file, however it is split."""
    columns = [column for text in _texts(content) for column in _columns(text)]
    wrong = []
    for index, name in enumerate(recording.names):
        values = recording.values[:, index]
        wanted = values[np.isfinite(values)]
        if wanted.size and not any(_stands_in(wanted, column) for column in columns):
            wrong.append(name)
    return wrong


def _texts(content: bytes) -> list[str]:
    texts = []
    for encoding in ("utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "latin-1"):
        try:
            texts.append(content.decode(encoding, errors="replace" if encoding.startswith("utf-8") else "strict"))
        except UnicodeError:
            continue
    return [text.replace("\r\r\n", "\n").replace("\r\n", "\n").replace("\r", "\n") for text in texts]


def _columns(text: str) -> list[np.ndarray]:
    columns = []
    for delimiter in (",", ";", "\t", " "):
        rows = []
        for line in text.split("\n"):
            line = re.sub(r"\s+", " ", line.strip()) if delimiter == " " else line
            rows.append(next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), []))
        for decimal in (".", ","):
            for column in range(min(40, max(map(len, rows)))):
                numbers = [_number(row[column], decimal) for row in rows if column < len(row)]
                columns.append(np.array([number for number in numbers if number is not None]))
    return columns


def _number(cell: str, decimal: str) -> float | None:
    cell = cell.strip()
    if not cell.isascii() or "_" in cell or (decimal == "," and "." in cell):
        return None
    try:
        number = float(cell.replace(decimal, "."))
    except ValueError:
        return None
    return number if np.isfinite(number) else None


def _stands_in(wanted: np.ndarray, column: np.ndarray) -> bool:
    starts = np.flatnonzero(column[: len(column) - len(wanted) + 1] == wanted[0])
    return any(np.array_equal(column[start : start + len(wanted)], wanted) for start in starts)


def check(seed: int, file: Path) -> tuple[bool, float]:
    """Read one mutated file: whether it was accepted, and how long that took (s). Fails if anything is wrong."""
    content = mutated(seed)
    file.write_bytes(content)
    begun = time.process_time()
    recording: Recording | None
    try:
        recording = read_recording(file, rate=None if seed % 3 else 1000.0)
    except UserError as error:
        line = str(error)
        assert "\n" not in line, f"seed {seed}: {line}"
        assert len(line) < 1000, f"seed {seed}: {line[:1000]}"
        recording = None
    spent = time.process_time() - begun
    assert spent < LONGEST, f"seed {seed}: {spent:.1f} s"
    if recording is None:
        return False, spent
    if not any("resampled" in note for note in recording.notes):
        wrong = wrong_numbers(recording, content)
        assert not wrong, f"seed {seed}: {', '.join(wrong)} hold other numbers than the file"
    return True, spent


def main(count: int) -> None:
    """Check so many files; print what was accepted, the longest time and the memory."""
    accepted, longest, failed = 0, 0.0, []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(count):
            try:
                one, spent = check(seed, Path(folder) / "file.csv")
                accepted, longest = accepted + one, max(longest, spent)
            except Exception as error:
                failed.append(f"seed {seed}: {type(error).__name__}: {error}")
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print("\n".join(failed[:50]))
    print(f"{count} files, {accepted} accepted, {len(failed)} failed, longest {longest:.2f} s, {memory / 1024:.0f} MiB")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 300)
